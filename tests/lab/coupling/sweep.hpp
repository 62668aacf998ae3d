#pragma once

#include "model/settings/settings.hpp"

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace subworld {

/// A setting of the table (model/settings), and the values that it takes.
struct SettingAxis {
  std::string key;
  std::vector<std::string> values;
};
/// Of KEY=V1,V2,...; a comma within brackets belongs to a value.
[[nodiscard]] SettingAxis parse_axis(const std::string& text);
/// What is wrong with it, with the cure; empty: nothing.
[[nodiscard]] std::string axis_fault(const std::string& text);

/// For Option::check(): one of a list of fixed ratios, beside an option --ratio-most.
[[nodiscard]] std::string fixed_ratio_fault(const std::string& text);

/// Requested values of each axis of the sweep. An h of 0 means the scene's own.
struct Sweep {
  std::vector<std::string> scenes;  ///< files
  std::vector<int> variants{0};     ///< of each scene (lab/variants); 0: itself
  std::vector<std::string> schemes{"paper_literal", "paper", "reduced"};
  std::vector<int> ratios{1, 4, 10, 20};
  std::vector<int> ratios_most{0};         ///< largest adaptive ratio; 0: the ratio is fixed
  std::vector<int> substeps{1};            ///< of the world, per cycle; 0: as the scheme requires
  std::vector<std::string> oracle{"off"};  ///< "on": the sub-worlds know the other users' devices without delay
  std::vector<double> stiffness_factors{1.0};
  std::vector<double> h_s{0.0};
  std::vector<SettingAxis> settings;
  std::optional<double> duration_s;
};

/// One run. An empty scheme and a ratio of 0 also mean the scene's own. The scene's delays and its deadband do not
/// count: without others there are none.
struct Point {
  std::string scene;
  int variant = 0;
  std::string scheme;
  int ratio = 1;
  int ratio_most = 0;
  int substeps = 1;
  std::string oracle = "off";
  double stiffness_factor = 1.0;
  double h_s = 0.0;
  std::vector<SettingChange> settings;
  double starts_later_s = 0.0;  ///< by which the paths of all users begin later
  std::optional<double> duration_s;

  bool operator==(const Point&) const = default;
};

/// The column of a setting in the tables: "latency_s", or its key with '_' for each dot.
[[nodiscard]] std::string column_of(const std::string& key);
/// The columns of settings that all rows have, with the keys of the settings.
[[nodiscard]] std::span<const std::pair<std::string_view, std::string_view>> usual_columns();

/// Every combination, once. Points with a common reference are consecutive; the ratio changes fastest.
[[nodiscard]] std::vector<Point> points_of(const Sweep& sweep);

/// The scene of a point. Throws `Error` (usage) for a scene, scheme or engine that does not exist.
[[nodiscard]] Scene scene_of(const Point& point);
/// The reference of the point: the whole scene in one world of the same engine at step h, without delay.
[[nodiscard]] Scene reference_scene_of(const Point& point);
/// The same at h / `factor`.
[[nodiscard]] Scene refined(Scene scene, int factor);
/// Equal for points with the same reference.
[[nodiscard]] std::string reference_key(const Point& point);

/// The ratio of the written and drawn traces: the nearest to 10.
[[nodiscard]] int shown_ratio(const std::vector<int>& ratios);
/// Whether the trace of this point is saved: at the shown ratio, with every other axis at its first value.
[[nodiscard]] bool shown(const Point& point, const Sweep& sweep);

}  // namespace subworld
