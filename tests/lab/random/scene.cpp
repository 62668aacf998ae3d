#include "lab/random/scene.hpp"

#include "lab/random/structures.hpp"
#include "lab/random/users.hpp"
#include "physics/engine.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr double kSmall_m = 0.035;  ///< some engines need another unit of length for smaller bodies

BodyRanges draw_ranges(Draw& draw) {
  BodyRanges ranges;
  ranges.size_m = rounded(draw.factor(0.008, 0.4));
  ranges.mass_kg = rounded(draw.factor(0.003, 4.0));
  ranges.mass_spread = draw.chance(0.2) ? 30.0 : draw.chance(0.4) ? 1.0 : 3.0;
  ranges.materials.clear();
  const int count = draw.whole(1, 3);
  for (int i = 0; i < count; ++i) {
    const double friction = draw.chance(0.15) ? 0.0 : rounded(draw.between(0.0, 1.5));
    const double restitution = draw.chance(0.5) ? 0.0 : draw.chance(0.2) ? 1.0 : rounded(draw.between(0.0, 1.0));
    ranges.materials.push_back({friction, restitution});
  }
  return ranges;
}

DelaySettings draw_delay(Draw& draw) {
  constexpr double kLongest_s = 0.1;
  DelaySettings delay;
  if (draw.chance(0.5)) return delay;
  const auto way = [&] { return draw.chance(0.5) ? 0.0 : rounded(draw.factor(1e-3, 0.5 * kLongest_s), 2); };
  delay.up_s = way();
  delay.down_s = way();
  delay.from_device_s = way();
  delay.to_device_s = way();
  if (draw.chance(0.4)) delay.jitter_s = rounded(draw.factor(1e-3, 0.02), 2);
  if (draw.chance(0.4)) delay.loss_ratio = rounded(draw.factor(0.01, 0.3), 2);
  delay.seed = static_cast<std::uint64_t>(draw.whole(1, 1000));
  return delay;
}

void draw_settings(Draw& draw, double smallest_m, Settings& s) {
  s.h_s = draw.chance(0.85) ? 0.001 : 0.0005;
  const int ratio = draw.chance(0.2) ? 1 : draw.whole(1, 20);
  s.set_ratio({ratio, draw.chance(0.1) ? std::min(20, ratio + draw.whole(1, 8)) : ratio});
  s.duration_s = rounded(draw.between(0.5, 1.1), 2);
  s.settle_s = draw.chance(0.5) ? 0.0 : rounded(draw.between(0.1, 0.4), 1);
  s.settle_step_s = s.h_s * draw.whole(1, 4);
  s.scheme = draw.one_of({"direct", "paper", "reduced", "reduced"});
  s.delay = draw_delay(draw);
  if (draw.chance(0.2)) s.passivity = draw.chance(0.7) ? Passivity::on : Passivity::off;
  if (draw.chance(0.1)) s.paper.device_force_in_world = false;
  if (draw.chance(0.1)) s.world.substeps = draw.whole(1, 3);
  // Bodies that are too small for some engines are simulated in another unit of length.
  if (smallest_m < kSmall_m) s.world.length_unit_m = s.haptic.length_unit_m = 0.1;
}

void draw_gravity(Draw& draw, bool floor, Settings& s) {
  Vec3 gravity = s.world.gravity;
  if (!floor || draw.chance(0.05)) {
    gravity.setZero();
  } else if (draw.chance(0.15)) {
    gravity = rounded(Vec3(draw.between(1.0, 12.0) * Vec3(0.1 * draw.direction() - Vec3::UnitZ())));
  }
  s.world.gravity = s.haptic.gravity = gravity;
}

double smallest_m(const Scene& scene) {
  double least = INFINITY;
  for (const Body& body : scene.bodies) {
    if (body.fixed()) continue;
    const Box box = bounds_of(scene, body, {});
    least = std::min(least, (box.upper - box.lower).minCoeff());
  }
  return least;
}

/// Structures side by side along x, around the origin.
void build_structures(Draw& draw, Builder& builder, double gap_m) {
  const int count = draw.whole(1, 3);
  int left = draw.whole(2, 18);
  double x = 0.0;
  for (int i = 0; i < count && left > 0; ++i) {
    const auto kind = static_cast<Structure>(draw.whole(0, static_cast<int>(kStructureNames.size()) - 1));
    const int most = i + 1 == count ? left : std::max(1, left / 2);
    x = builder.build(kind, x, most) + gap_m;
    left -= most;
  }
}

/// Gives some bodies a velocity, and all of them if there is no floor.
void set_going(Draw& draw, Scene& scene, bool floor) {
  if (floor && !draw.chance(0.25)) return;
  for (const Body& body : scene.bodies) {
    if (body.fixed() || !draw.chance(floor ? 0.3 : 0.7)) continue;
    BodyState& state = scene.initial[index(body.id)];
    state.linear_velocity = rounded(Vec3(draw.factor(0.02, 1.0) * draw.direction()));
    if (draw.chance(0.5)) state.angular_velocity = rounded(Vec3(draw.factor(0.2, 10.0) * draw.direction()));
  }
}

}  // namespace

Scene random_scene(std::uint64_t seed, std::uint64_t index) {
  Draw draw(seed, index);
  Scene scene;
  scene.name = fmt::format("random_{}_{}", seed, index);
  scene.description = fmt::format("Scene {} of seed {}.", index, seed);
  const BodyRanges ranges = draw_ranges(draw);
  Builder builder(scene, draw, ranges);
  const bool floor = draw.chance(0.92);
  if (floor) builder.add_floor(rounded(40.0 * ranges.size_m));
  build_structures(draw, builder, ranges.size_m);
  set_going(draw, scene, floor);
  const int users = draw.chance(0.6) ? 1 : draw.whole(2, 3);
  for (int u = 0; u < users; ++u) add_user(draw, builder, ranges, scene);
  draw_settings(draw, smallest_m(scene), scene.settings);
  draw_gravity(draw, floor, scene.settings);
  // Settling bodies may come to rest at the place where a tool is added.
  if (std::ranges::any_of(scene.users, &UserSpec::joins_late)) scene.settings.settle_s = 0.0;
  keep_users(scene, users);
  return scene;
}

Overlap deepest_overlap(const Scene& scene) {
  constexpr double kHardly_s = 1e-9;
  EngineSettings settings = scene.settings.world;
  settings.name = "bullet";
  settings.preset = "fast";
  settings.iterations.reset();
  const auto engine = make_engine(settings, scene.meshes);
  for (const Body& body : scene.bodies) engine->add(body, scene.initial[index(body.id)]);
  engine->step(kHardly_s);
  Overlap deepest;
  for (const Contact& c : engine->contacts()) {
    if (-c.distance > deepest.depth_m) deepest = {-c.distance, c.a, c.b};
  }
  return deepest;
}

}  // namespace subworld
