#pragma once

#include "model/scene.hpp"

#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// Requested values of each axis of the sweep. An empty name or word, a box of 0, an h of 0, a budget of 0 and a depth
/// of -1 mean the scene's own.
struct Sweep {
  std::vector<std::string> scenes;  ///< files
  std::vector<int> variants{0};     ///< of each scene (lab/variants); 0: itself
  std::vector<std::string> schemes{"paper_literal", "paper", "reduced"};
  std::vector<std::string> engines{""};
  std::vector<std::string> haptic_engines{""};
  std::vector<int> ratios{1, 4, 10, 20};
  std::vector<int> ratios_most{0};   ///< largest adaptive ratio; 0: the ratio is fixed
  std::vector<double> boxes_m{0.0};  ///< half sides
  std::vector<int> contact_depths{-1};
  std::vector<double> budget_ratios{0.0};  ///< shares of h
  std::vector<int> substeps{1};            ///< of the world, per cycle; 0: as the scheme requires
  std::vector<double> latencies_s{0.0};
  std::vector<double> jitters_s{0.0};
  std::vector<double> device_latencies_s{0.0};
  std::vector<double> loss_ratios{0.0};
  std::vector<double> deadbands{0.0};  ///< Weber fractions
  std::vector<std::string> passivities{""};
  std::vector<double> stiffness_factors{1.0};
  std::vector<double> h_s{0.0};
  std::optional<double> duration_s;
};

/// One run. An empty scheme and a ratio of 0 also mean the scene's own.
struct Point {
  std::string scene;
  int variant = 0;
  std::string scheme;
  std::string engine;
  std::string haptic_engine;
  int ratio = 1;
  int ratio_most = 0;
  double box_m = 0.0;
  int contact_depth = -1;
  double budget_ratio = 0.0;
  int substeps = 1;
  double latency_s = 0.0;  ///< added to the round trip, half each way
  double jitter_s = 0.0;
  double device_latency_s = 0.0;  ///< the same between device and sub-world
  double loss_ratio = 0.0;
  double deadband = 0.0;
  std::string passivity;
  double stiffness_factor = 1.0;
  double h_s = 0.0;
  double starts_later_s = 0.0;  ///< by which the paths of all users begin later
  std::optional<double> duration_s;

  bool operator==(const Point&) const = default;
};

/// Every combination, once. Points with a common reference are consecutive; the ratio changes fastest.
[[nodiscard]] std::vector<Point> points_of(const Sweep& sweep);

/// The scene of a point. Throws `Error` (usage) for a scene, scheme or engine that does not exist.
[[nodiscard]] Scene scene_of(const Point& point);
/// The reference of the point: the whole scene in one world of the same engine at step h, without delay.
[[nodiscard]] Scene reference_scene_of(const Point& point);
/// The whole scene in one world at step h, without delay and without a bound on the energy of the devices.
[[nodiscard]] Scene in_one_world(Scene scene);
/// The same at h / `factor`.
[[nodiscard]] Scene refined(Scene scene, int factor);
/// Equal for points with the same reference.
[[nodiscard]] std::string reference_key(const Point& point);

/// The ratio of the written and drawn traces: the nearest to 10.
[[nodiscard]] int shown_ratio(const std::vector<int>& ratios);
/// Whether the trace of this point is saved: at the shown ratio, with every other axis at its first value.
[[nodiscard]] bool shown(const Point& point, const Sweep& sweep);

}  // namespace subworld
