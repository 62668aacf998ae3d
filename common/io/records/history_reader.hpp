#pragma once

#include <cstddef>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// Reads the history of a program (io/history): its columns, and its rows one at a time. Rows that are not complete, as
/// the last one of a killed program, are not read. An empty cell is not a number. A file that does not exist has no
/// columns.
class HistoryReader {
 public:
  explicit HistoryReader(const std::string& file);

  /// The next complete row; false: there is none.
  bool next();
  /// The value in a column of this row; 0 without such a column or row.
  [[nodiscard]] double at(const std::string& column) const;
  /// The place of a column, for value().
  [[nodiscard]] std::optional<std::size_t> find(const std::string& column) const;
  [[nodiscard]] double value(std::size_t place) const noexcept { return row_[place]; }
  /// Of the vector whose x component has this name, as in "force_x_n".
  [[nodiscard]] double norm(const std::string& begin, const std::string& unit) const;

 private:
  bool read_line();

  std::ifstream file_;
  std::map<std::string, std::size_t> columns_;
  std::string line_;
  std::vector<double> row_, read_;
};

}  // namespace subworld
