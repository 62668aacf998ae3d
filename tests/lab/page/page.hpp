#pragma once

#include "lab/page/plots.hpp"
#include "lab/page/tables.hpp"

#include <fstream>
#include <string>
#include <vector>

/// A report as one self-contained page.
namespace subworld {

[[nodiscard]] std::string escaped(const std::string& text);

/// The number with these significant digits, or a dash if it is not a number.
[[nodiscard]] std::string digits_of(double number, int digits);

/// A column of a table of numbers.
struct Column {
  const char* title;
  const char* key;
  double scale;
  int digits;                   ///< significant
  const char* inner = nullptr;  ///< of a nested object
  bool only_swept = false;      ///< omitted if all rows have the same value
};
/// The cell of a row, or a dash if it is not a number.
[[nodiscard]] std::string cell_of(const Column& column, const Json& row);

/// A table of texts (already escaped).
struct TextTable {
  std::vector<std::string> head;
  std::vector<std::vector<std::string>> rows = {};
  std::size_t texts = 1;  ///< number of first columns with text, left-aligned
  bool remarks = false;   ///< the last column is text too
};
[[nodiscard]] std::string html_of(const TextTable& table);

class Page {
 public:
  /// close() throws `Error` (failed) if the file cannot be written.
  Page(const std::string& path, const std::string& title);
  /// Title, `what` was run, date, machine and verdict of a summary.
  void intro(const std::string& what, const Json& summary);
  void add(const std::string& html) { file_ << html; }
  void heading(const std::string& text) { file_ << "<h2>" << escaped(text) << "</h2>\n"; }
  /// Side by side.
  void plots(const std::string* first, std::size_t count);
  void close();

 private:
  std::string path_;
  std::string title_;
  std::ofstream file_;
};

}  // namespace subworld
