#include "lab/coupling/sweep.hpp"

#include "coupling/schemes/scheme.hpp"
#include "io/options/options.hpp"
#include "lab/session/coupled_run.hpp"
#include "lab/session/variants.hpp"
#include "model/error.hpp"
#include "physics/engine.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
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

constexpr std::array<std::pair<std::string_view, std::string_view>, 13> kUsual{
    {{"engine", "world.engine"},
     {"haptic_engine", "haptic.engine"},
     {"h_s", "h_s"},
     {"box_m", "users.box_half_m"},
     {"contact_depth", "users.contact_depth"},
     {"budget_ratio", "users.budget_ratio"},
     {"latency_s", "delay.latency_s"},
     {"jitter_s", "delay.jitter_s"},
     {"device_latency_s", "delay.device_latency_s"},
     {"loss_ratio", "delay.loss_ratio"},
     {"deadband", "deadband"},
     {"passivity", "passivity"},
     {"coupling_stiffness_n_m", "users.coupling.stiffness_n_m"}}};

/// Whether a setting acts in a single world too, so that it changes the reference.
bool acts_in_one_world(std::string_view key) {
  constexpr std::string_view kOthers[] = {
      "delay.",          "deadband",         "passivity",           "haptic.",           "disable",
      "users.selection", "users.box_half_m", "users.contact_depth", "users.budget_ratio"};
  return std::ranges::none_of(kOthers, [&](std::string_view begin) { return key.starts_with(begin); });
}

Scene loaded(const Point& point) {
  Options options;
  options.scene = point.scene;
  change(options, "mode", "lockstep");
  Scene scene = load_scene(options);
  Settings& s = scene.settings;
  s.world.substeps.reset();
  s.delay = {};
  s.deadband = 0.0;
  apply_changes(point.settings, scene);
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
  std::vector<Axis> axes{axis(sweep.scenes, &Point::scene), axis(sweep.variants, &Point::variant),
                         axis(sweep.h_s, &Point::h_s), axis(sweep.stiffness_factors, &Point::stiffness_factor)};
  const auto add_settings = [&](bool in_one_world) {
    for (const SettingAxis& one : sweep.settings) {
      if (acts_in_one_world(one.key) != in_one_world) continue;
      axes.push_back({one.values.size(), [&one](Point& point, std::size_t i) {
                        point.settings.push_back({one.key, one.values[i]});
                      }});
    }
  };
  add_settings(true);
  axes.push_back(axis(sweep.schemes, &Point::scheme));
  axes.push_back(axis(sweep.substeps, &Point::substeps));
  axes.push_back(axis(sweep.oracle, &Point::oracle));
  add_settings(false);
  axes.push_back(axis(sweep.ratios_most, &Point::ratio_most));
  axes.push_back(axis(sweep.ratios, &Point::ratio));
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
  if (point.substeps > 0) s.world.substeps = point.substeps;
  (void)scheme_of(s);
  (void)make_engine(s.world, {});
  (void)make_engine(s.haptic, {});
  return scene;
}

Scene reference_scene_of(const Point& point) { return in_one_world(loaded(point)); }

Scene refined(Scene scene, int factor) {
  scene.settings.h_s /= factor;
  for (UserSpec& user : scene.users) user.device.rate_hz *= factor;
  return scene;
}

std::string reference_key(const Point& p) {
  std::string key = fmt::format("{}|{}|{}|{}|{}", p.scene, p.variant, p.h_s, p.stiffness_factor, p.starts_later_s);
  for (const SettingChange& one : p.settings) {
    if (acts_in_one_world(one.key)) key += fmt::format("|{}={}", one.key, one.value);
  }
  return key;
}

int shown_ratio(const std::vector<int>& ratios) {
  return *std::ranges::min_element(ratios, {}, [](int r) { return std::abs(r - 10); });
}

bool shown(const Point& p, const Sweep& s) {
  const auto first = [&](const SettingChange& one) {
    const auto axis = std::ranges::find(s.settings, one.key, &SettingAxis::key);
    return one.key == "delay.latency_s" || axis == s.settings.end() || one.value == axis->values.front();
  };
  return p.ratio == shown_ratio(s.ratios) && p.ratio_most == s.ratios_most.front() && p.variant == s.variants.front() &&
         p.substeps == s.substeps.front() && p.oracle == s.oracle.front() &&
         p.stiffness_factor == s.stiffness_factors.front() && p.h_s == s.h_s.front() &&
         std::ranges::all_of(p.settings, first);
}

namespace {

/// Two ratios in either order, as in 4-12 or 12-4.
std::optional<RatioBounds> parse_two_ratios(const std::string& text) {
  const std::size_t dash = text.find('-');
  if (dash == std::string::npos) return std::nullopt;
  const auto bounds = parse_ratio(text);
  return bounds ? bounds : parse_ratio(text.substr(dash + 1) + "-" + text.substr(0, dash));
}

}  // namespace

std::string fixed_ratio_fault(const std::string& text) {
  if (const auto two = parse_two_ratios(text))
    return fmt::format("must be one ratio; for one that adapts give --ratio {} --ratio-most {}", two->least, two->most);
  return parse_ratio(text) ? "" : fmt::format("must be a whole number from 1 to {}", kMostRatio);
}

SettingAxis parse_axis(const std::string& text) {
  const SettingChange whole = parse_change(text);
  SettingAxis axis{whole.key, {""}};
  int open = 0;
  for (const char c : whole.value) {
    open += c == '[' ? 1 : c == ']' ? -1 : 0;
    if (c == ',' && open == 0) {
      axis.values.emplace_back();
    } else {
      axis.values.back() += c;
    }
  }
  return axis;
}

std::string axis_fault(const std::string& text) {
  const SettingAxis axis = parse_axis(text);
  for (const std::string& value : axis.values) {
    if (const std::string fault = setting_fault({axis.key, value}); !fault.empty()) return fault;
  }
  for (const std::string_view other : {"scheme", "ratio", "duration_s", "world.substeps", "h_s", "mode"}) {
    if (axis.key == other) return fmt::format("this lab has an option of its own for {}", other);
  }
  return {};
}

std::string column_of(const std::string& key) {
  const auto usual =
      std::ranges::find(kUsual, std::string_view(key), &std::pair<std::string_view, std::string_view>::second);
  std::string column(usual != kUsual.end() ? usual->first : key);
  std::ranges::replace(column, '.', '_');
  return column;
}

std::span<const std::pair<std::string_view, std::string_view>> usual_columns() { return kUsual; }

}  // namespace subworld
