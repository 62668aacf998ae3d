#pragma once

#include "io/results/json.hpp"

#include <string>
#include <vector>

namespace subworld {

using Rows = std::vector<Json>;  ///< one flat row per measured point

/// The number in a column; not a number if the cell is `null`.
[[nodiscard]] double number(const Json& row, const std::string& column);
/// Whether the rows are equal in all of the columns.
[[nodiscard]] bool alike(const Json& a, const Json& b, const std::vector<std::string>& columns);
/// Groups the rows by scene, in order.
[[nodiscard]] std::vector<Rows> by_scene(const Rows& rows);

/// The rows of a JSON file; none where there is no such file. Throws `Error` (failed) if it is no table.
[[nodiscard]] Rows read_rows(const std::string& path);

/// Writes a table. An object in a row becomes a column for each of its entries, `null` an empty cell. Throws `Error`
/// (failed).
void write_csv(const std::string& path, const Rows& rows);

/// Least squares y = a + b x.
class LineFit {
 public:
  void add(double x, double y);
  [[nodiscard]] int count() const { return count_; }
  [[nodiscard]] double spread() const { return count_ * sum_xx_ - sum_x_ * sum_x_; }  ///< 0: no slope
  [[nodiscard]] double slope() const { return (count_ * sum_xy_ - sum_x_ * sum_y_) / spread(); }
  [[nodiscard]] double offset() const { return (sum_y_ - slope() * sum_x_) / count_; }
  /// Share of the variance of y that the line explains, 0 .. 1.
  [[nodiscard]] double r_squared() const;
  /// Standard error of the slope, from the residuals; not a number for fewer than three points.
  [[nodiscard]] double standard_error() const;

 private:
  [[nodiscard]] double y_spread() const { return count_ * sum_yy_ - sum_y_ * sum_y_; }
  double sum_x_ = 0.0, sum_y_ = 0.0, sum_xx_ = 0.0, sum_xy_ = 0.0, sum_yy_ = 0.0;
  int count_ = 0;
};

}  // namespace subworld
