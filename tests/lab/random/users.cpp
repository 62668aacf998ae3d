#include "lab/random/users.hpp"

#include "model/trigonometry.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr double kClear_m = 5e-4;

bool is_proxy(const Scene& scene, BodyId id) {
  return std::ranges::find(scene.users, id, &UserSpec::proxy) != scene.users.end();
}

/// Whether no body's bounds are within this radius.
bool is_clear(const Scene& scene, const Vec3& place, double radius_m) {
  return std::ranges::all_of(scene.bodies, [&](const Body& body) {
    if (body.shape.kind == ShapeKind::plane) return place.z() > radius_m + kClear_m;
    const Box box = bounds_of(scene, body, scene.initial[index(body.id)]);
    // Mesh ground: no place below it.
    if (body.shape.kind == ShapeKind::mesh && place.z() < box.upper.z()) return false;
    return (place - place.cwiseMax(box.lower).cwiseMin(box.upper)).norm() > radius_m + kClear_m;
  });
}

/// A free place near the target, beside or above it; far above if there is none.
Vec3 clear_place(Draw& draw, const Scene& scene, const Vec3& target, double target_m, double radius_m) {
  for (int i = 0; i < 40; ++i) {
    Vec3 way = draw.direction();
    if (draw.chance(0.6)) way.z() = 0.3 * std::abs(way.z());
    const double gap_m = draw.factor(1e-3, 1.0) * target_m;
    const Vec3 place = rounded(Vec3(target + (target_m + radius_m + gap_m) * way.normalized()), 4);
    if (is_clear(scene, place, radius_m)) return place;
  }
  double top = 0.0;
  for (const Body& body : scene.bodies) {
    if (body.shape.kind != ShapeKind::plane)
      top = std::max(top, bounds_of(scene, body, scene.initial[index(body.id)]).upper.z());
  }
  return rounded(Vec3(target.x(), target.y(), top + 2.0 * radius_m + kClear_m), 4);
}

BodyId draw_target(Draw& draw, const Scene& scene) {
  std::vector<BodyId> movable;
  for (const Body& body : scene.bodies) {
    if (!body.fixed() && !is_proxy(scene, body.id)) movable.push_back(body.id);
  }
  if (movable.empty()) return scene.users.front().proxy;
  return movable[static_cast<std::size_t>(draw.whole(0, static_cast<int>(movable.size()) - 1))];
}

/// A move within the scene's duration.
PathSegment move(const Vec3& by, double from_s, double speed_m_s) {
  constexpr double kShortest_s = 0.02, kLongest_s = 0.5;
  const double lasts_s = std::clamp(by.norm() / speed_m_s, kShortest_s, kLongest_s);
  PathSegment segment{.from_s = rounded(from_s, 4), .displacement = rounded(by)};
  segment.to_s = rounded(segment.from_s + lasts_s, 4);
  return segment;
}

std::vector<PathSegment> draw_path(Draw& draw, const Vec3& way, double size_m, bool turns) {
  std::vector<PathSegment> path;
  const double speed_m_s = draw.factor(0.03, 0.6);
  path.push_back(move(draw.between(0.4, 1.6) * way, draw.between(0.0, 0.1), speed_m_s));
  if (draw.chance(0.6))
    path.push_back(move(draw.factor(0.1, 1.0) * size_m * draw.direction(), path[0].to_s + draw.between(0.0, 0.2),
                        draw.factor(0.03, 0.6)));
  if (draw.chance(0.4)) path.push_back(move(-draw.between(0.5, 1.5) * way, path.back().to_s + 0.05, speed_m_s));
  if (draw.chance(0.2)) {
    PathSegment circle{.kind = PathSegment::Kind::circle, .from_s = rounded(draw.between(0.0, 0.5))};
    circle.to_s = INFINITY;
    circle.axis = rounded(draw.direction()).normalized();
    circle.radius = rounded(draw.factor(0.05, 0.5) * size_m);
    circle.period_s = rounded(draw.between(0.3, 2.0));
    path.push_back(circle);
  }
  if (draw.chance(0.1)) {
    PathSegment wave{.kind = PathSegment::Kind::wave};
    wave.to_s = INFINITY;
    wave.amplitude = rounded(0.1 * size_m);
    wave.wavenumber = rounded(draw.between(1.0, 5.0) / size_m);
    path.push_back(wave);
  }
  if (turns && draw.chance(0.6)) {
    PathSegment turn{.kind = PathSegment::Kind::turn, .from_s = 0.1};
    turn.to_s = rounded(draw.between(0.3, 0.9));
    turn.axis = rounded(draw.direction()).normalized();
    turn.angle = rounded(draw.between(-1.5, 1.5));
    path.push_back(turn);
  }
  return path;
}

/// Limits the speed of the path: a device that lags behind its operator would leave the tool behind.
void slow_down(std::vector<PathSegment>& path, double most_m_s) {
  for (PathSegment& s : path) {
    if (s.kind == PathSegment::Kind::move) {
      const double speed_m_s = s.displacement.norm() / (s.to_s - s.from_s);
      if (speed_m_s > most_m_s) s.displacement = rounded(Vec3(most_m_s / speed_m_s * s.displacement));
    }
    if (s.kind == PathSegment::Kind::circle)
      s.radius = std::min(s.radius, rounded(most_m_s * s.period_s / (2.0 * M_PI)));
  }
}

CouplingSettings draw_coupling(Draw& draw, double mass_kg, const Vec3& inertia) {
  CouplingSettings k;
  k.stiffness_n_m = rounded(draw.factor(50.0, 3000.0), 2);
  k.damping_n_s_m = rounded(draw.between(0.1, 1.5) * 2.0 * std::sqrt(k.stiffness_n_m * mass_kg), 2);
  k.rotational_stiffness_n_m = rounded(draw.factor(0.05, 5.0), 2);
  const double middle = inertia.sum() / 3.0;
  k.rotational_damping_n_m_s =
      rounded(draw.between(0.1, 1.5) * 2.0 * std::sqrt(k.rotational_stiffness_n_m * middle), 2);
  k.ramp_s = draw.chance(0.7) ? 0.1 : 0.02;
  return k;
}

DeviceSpec draw_device(Draw& draw) {
  DeviceSpec device;
  device.kind = draw.chance(0.7) ? DeviceKind::impedance : DeviceKind::admittance;
  device.degrees_of_freedom = draw.chance(0.7) ? 3 : 6;
  device.rate_hz = draw.one_of({1000.0, 1000.0, 2000.0, 4000.0, 500.0});
  device.force_limit_n = rounded(draw.factor(3.0, 60.0), 2);
  device.torque_limit_n_m = rounded(draw.factor(0.1, 2.0), 2);
  if (draw.chance(0.1)) device.force_rate_limit_n_s = rounded(draw.factor(1e3, 1e4), 2);
  if (draw.chance(0.1)) device.power_limit_w = rounded(draw.factor(1.0, 40.0), 2);
  device.mass_kg = rounded(draw.factor(0.05, 0.5), 2);
  device.damping_n_s_m = rounded(draw.factor(0.1, 5.0), 2);
  device.friction_n = draw.chance(0.5) ? 0.0 : rounded(draw.factor(0.02, 0.5), 2);
  device.position_resolution_m = draw.chance(0.6) ? 0.0 : rounded(draw.factor(1e-6, 1e-4), 2);
  return device;
}

OperatorSpec draw_operator(Draw& draw, const DeviceSpec& device, const Body& tool) {
  OperatorSpec model;
  model.mass_kg = rounded(draw.factor(0.2, 2.0), 2);
  model.damping_n_s_m = rounded(draw.factor(3.0, 30.0), 2);
  model.stiffness_n_m = rounded(draw.factor(50.0, 600.0), 2);
  if (device.kind == DeviceKind::impedance) return model;
  // An admittance device follows with the lag of its drives, 50 Hz. An operator who is too stiff for the mass of the
  // tool cannot hold it still, whatever is simulated. Therefore the operator's natural frequency is at most 5 Hz.
  constexpr double kFastest_rad_s = 2.0 * M_PI * 5.0;
  const double part = draw.factor(0.1, 1.0), inertia = tool.inertia.minCoeff();
  model.stiffness_n_m = rounded(part * kFastest_rad_s * kFastest_rad_s * tool.mass, 2);
  model.damping_n_s_m = rounded(draw.between(0.5, 1.5) * std::sqrt(model.stiffness_n_m * tool.mass), 2);
  model.rotational_stiffness_n_m = rounded(part * kFastest_rad_s * kFastest_rad_s * inertia, 2);
  model.rotational_damping_n_m_s =
      rounded(draw.between(0.5, 1.5) * std::sqrt(model.rotational_stiffness_n_m * inertia), 2);
  return model;
}

Body draw_tool(Draw& draw, Builder& builder, double size_m, bool rotates) {
  Body tool;
  const ShapeKind kind =
      draw.chance(0.5) ? ShapeKind::sphere
                       : draw.one_of({ShapeKind::box, ShapeKind::capsule, ShapeKind::cylinder, ShapeKind::convex});
  tool.shape = builder.draw_shape(kind, size_m * draw.between(0.5, 1.0));
  tool.material = builder.draw_material();
  tool.gravity = draw.chance(0.15);
  tool.rotates = rotates || draw.chance(0.1);
  builder.set_mass(tool, rounded(draw.factor(0.02, 1.0), 2));
  return tool;
}

void draw_selection(Draw& draw, double size_m, UserSpec& user) {
  user.selection = draw.one_of({Selection::budget, Selection::box, Selection::contacts});
  user.contact_depth = user.selection == Selection::contacts ? draw.whole(1, 4) : draw.whole(0, 2);
  user.box_half_m = rounded(draw.factor(0.7, 4.0) * size_m, 2);
  user.budget_ratio = rounded(draw.factor(0.1, 1.0), 2);
}

}  // namespace

void add_user(Draw& draw, Builder& builder, const BodyRanges& ranges, Scene& scene) {
  UserSpec user;
  user.name = fmt::format("user{}", scene.users.size());
  user.device = draw_device(draw);
  const BodyId target = draw_target(draw, scene);
  const Vec3 goal = scene.initial[index(target)].position;
  const bool own = draw.chance(0.9) || is_proxy(scene, target) || !scene.users.empty();
  Vec3 way = 0.5 * ranges.size_m * draw.direction();
  if (own) {
    const Body tool = draw_tool(draw, builder, ranges.size_m, user.device.degrees_of_freedom == 6);
    const Box reach = bounds_of(scene, tool, {}), wide = bounds_of(scene, scene.body(target), {});
    const double target_m = 0.5 * (wide.upper - wide.lower).maxCoeff();
    BodyState state;
    state.position = clear_place(draw, scene, goal, target_m, reach.upper.cwiseMax(-reach.lower).norm());
    way = goal - state.position;
    user.proxy = builder.add(tool, state, "tool");
    scene.bodies[index(user.proxy)].name = user.name + "/proxy";
    user.own_proxy = true;
    user.joins_late = draw.chance(0.1);
  } else {
    user.proxy = target;
  }
  user.device.path = draw_path(draw, way, ranges.size_m, user.device.degrees_of_freedom == 6);
  if (user.device.kind == DeviceKind::admittance) slow_down(user.device.path, 0.75 * user.device.speed_limit_m_s);
  const Body& proxy = scene.body(user.proxy);
  user.coupling = draw_coupling(draw, proxy.mass, proxy.inertia);
  if (user.device.kind == DeviceKind::admittance || draw.chance(0.5))
    user.device.operator_model = draw_operator(draw, user.device, proxy);
  draw_selection(draw, ranges.size_m, user);
  scene.users.push_back(std::move(user));
}

}  // namespace subworld
