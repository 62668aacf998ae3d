#pragma once

#include <string>
#include <utility>
#include <vector>

namespace subworld {

struct Series {
  std::string title;
  std::string colour;  ///< "#rrggbb"
  double width = 2.0;
  int mark = 7;  ///< gnuplot's point type; 0: a line only
  bool dashed = false;
  std::vector<std::pair<double, double>> points;
};

/// A horizontal line.
struct Level {
  std::string title;
  std::string colour;
  double value = 0.0;
};

struct Plot {
  std::string title;
  std::string x_label;  ///< with unit
  std::string y_label;
  bool log_x = false;
  bool log_y = false;
  bool tight_x = false;                   ///< the x axis ends with the data
  std::vector<double> x_ticks;            ///< empty: automatic
  std::vector<std::string> x_names = {};  ///< of x = 1, 2 ...; "\n" begins a line
  std::vector<Series> series;
  std::vector<Level> levels;
};

/// The plots as SVG elements, drawn by gnuplot. Throws `Error` (failed) with the cure where gnuplot is missing.
[[nodiscard]] std::vector<std::string> svg_of(const std::vector<Plot>& plots);

}  // namespace subworld
