#include "lab/coupling/sweep.hpp"

#include "coupling/scheme.hpp"
#include "io/options.hpp"
#include "lab/session/variants.hpp"
#include "model/error.hpp"
#include "physics/engine.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <functional>

namespace subworld {

namespace {

constexpr double kMostSteps = 1e7;  ///< of a run; a larger number is a typing error

struct Axis {
  std::size_t count;
  std::function<void(Point&, std::size_t)> choose;
};

template <class T>
Axis axis(const std::vector<T>& values, T Point::*member) {
  return {values.size(), [&values, member](Point& point, std::size_t i) { point.*member = values[i]; }};
}

Scene loaded(const Point& point) {
  Options options;
  options.scene = point.scene;
  options.mode = "lockstep";
  if (!point.passivity.empty()) options.passivity = point.passivity;
  Scene scene = load_scene(options);
  Settings& s = scene.settings;
  if (!point.engine.empty()) {
    s.world.name = point.engine;
    s.world.longest_substep_s.reset();
  }
  if (!point.haptic_engine.empty()) s.haptic.name = point.haptic_engine;
  if (point.duration_s) s.duration_s = *point.duration_s;
  if (point.h_s > 0.0) {
    for (UserSpec& user : scene.users) user.device.rate_hz *= s.h_s / point.h_s;
    s.h_s = point.h_s;
  }
  if (s.duration_s / s.h_s > kMostSteps) {
    throw Error(ExitCode::usage, fmt::format("{}: {:g} s in steps of {:g} s are more than {:g} steps; take a shorter "
                                             "--duration or a longer --h",
                                             point.scene, s.duration_s, s.h_s, kMostSteps));
  }
  for (UserSpec& user : scene.users) {
    user.coupling.stiffness_n_m *= point.stiffness_factor;
    for (PathSegment& segment : user.device.path) {
      segment.from_s += point.starts_later_s;
      segment.to_s += point.starts_later_s;
    }
  }
  return varied(std::move(scene), point.variant);
}

}  // namespace

std::vector<Point> points_of(const Sweep& sweep) {
  const std::vector<Axis> axes{axis(sweep.scenes, &Point::scene),
                               axis(sweep.variants, &Point::variant),
                               axis(sweep.h_s, &Point::h_s),
                               axis(sweep.stiffness_factors, &Point::stiffness_factor),
                               axis(sweep.engines, &Point::engine),
                               axis(sweep.haptic_engines, &Point::haptic_engine),
                               axis(sweep.schemes, &Point::scheme),
                               axis(sweep.boxes_m, &Point::box_m),
                               axis(sweep.contact_depths, &Point::contact_depth),
                               axis(sweep.budget_ratios, &Point::budget_ratio),
                               axis(sweep.substeps, &Point::substeps),
                               axis(sweep.latencies_s, &Point::latency_s),
                               axis(sweep.jitters_s, &Point::jitter_s),
                               axis(sweep.device_latencies_s, &Point::device_latency_s),
                               axis(sweep.loss_ratios, &Point::loss_ratio),
                               axis(sweep.deadbands, &Point::deadband),
                               axis(sweep.passivities, &Point::passivity),
                               axis(sweep.ratios_most, &Point::ratio_most),
                               axis(sweep.ratios, &Point::ratio)};
  std::size_t count = 1;
  for (const Axis& a : axes) count *= a.count;
  std::vector<Point> points;
  for (std::size_t i = 0; i < count; ++i) {
    Point point;
    point.duration_s = sweep.duration_s;
    std::size_t rest = i;
    for (auto a = axes.rbegin(); a != axes.rend(); ++a) {
      a->choose(point, rest % a->count);
      rest /= a->count;
    }
    if (std::ranges::find(points, point) == points.end()) points.push_back(std::move(point));
  }
  return points;
}

Scene scene_of(const Point& point) {
  Scene scene = loaded(point);
  Settings& s = scene.settings;
  const bool literal = point.scheme == "paper_literal";
  if (!point.scheme.empty()) s.scheme = literal ? "paper" : point.scheme;
  s.paper.device_force_in_world = !literal;
  if (point.ratio > 0) s.set_ratio({point.ratio, point.ratio_most});
  s.world.substeps.reset();
  if (point.substeps > 0) s.world.substeps = point.substeps;
  s.delay = {.up_s = 0.5 * point.latency_s,
             .down_s = 0.5 * point.latency_s,
             .from_device_s = 0.5 * point.device_latency_s,
             .to_device_s = 0.5 * point.device_latency_s,
             .jitter_s = point.jitter_s,
             .loss_ratio = point.loss_ratio};
  s.deadband = point.deadband;
  for (UserSpec& user : scene.users) {
    if (point.box_m > 0.0) user.box_half_m = point.box_m;
    if (point.contact_depth >= 0) user.contact_depth = point.contact_depth;
    if (point.budget_ratio > 0.0) {
      user.selection = Selection::budget;
      user.budget_ratio = point.budget_ratio;
    }
  }
  (void)scheme_of(s);
  (void)make_engine(s.world, {});
  (void)make_engine(s.haptic, {});
  return scene;
}

Scene reference_scene_of(const Point& point) { return in_one_world(loaded(point)); }

Scene in_one_world(Scene scene) {
  scene.settings.scheme = "direct";
  scene.settings.set_ratio({1, 1});
  scene.settings.world.substeps = 1;
  scene.settings.delay = {};
  scene.settings.passivity = Passivity::off;
  scene.settings.deadband = 0.0;
  return scene;
}

Scene refined(Scene scene, int factor) {
  scene.settings.h_s /= factor;
  for (UserSpec& user : scene.users) user.device.rate_hz *= factor;
  return scene;
}

std::string reference_key(const Point& p) {
  return fmt::format("{}|{}|{}|{}|{}|{}", p.scene, p.variant, p.h_s, p.stiffness_factor, p.engine, p.starts_later_s);
}

int shown_ratio(const std::vector<int>& ratios) {
  return *std::ranges::min_element(ratios, {}, [](int r) { return std::abs(r - 10); });
}

bool shown(const Point& p, const Sweep& s) {
  return p.ratio == shown_ratio(s.ratios) && p.ratio_most == s.ratios_most.front() && p.variant == s.variants.front() &&
         p.engine == s.engines.front() && p.haptic_engine == s.haptic_engines.front() && p.box_m == s.boxes_m.front() &&
         p.contact_depth == s.contact_depths.front() && p.budget_ratio == s.budget_ratios.front() &&
         p.substeps == s.substeps.front() && p.jitter_s == s.jitters_s.front() &&
         p.device_latency_s == s.device_latencies_s.front() && p.loss_ratio == s.loss_ratios.front() &&
         p.deadband == s.deadbands.front() && p.passivity == s.passivities.front() &&
         p.stiffness_factor == s.stiffness_factors.front() && p.h_s == s.h_s.front();
}

}  // namespace subworld
