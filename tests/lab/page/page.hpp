#pragma once

#include "lab/page/plots.hpp"
#include "lab/page/tables.hpp"

#include <fstream>
#include <string>
#include <vector>

/// A report: one page that needs nothing beside it.
namespace subworld {

[[nodiscard]] std::string escaped(const std::string& text);

/// So many significant digits, whole numbers whole; or a dash where it is no number.
[[nodiscard]] std::string digits_of(double number, int digits);

/// A column of a table of numbers.
struct Column {
  const char* title;
  const char* key;
  double scale;
  int digits;                   ///< significant
  const char* inner = nullptr;  ///< of an object
  bool only_swept = false;      ///< left out where all rows are alike
};
/// The cell of a row, or a dash where it is no number.
[[nodiscard]] std::string cell_of(const Column& column, const Json& row);

/// A table of texts (already escaped).
struct TextTable {
  std::vector<std::string> head;
  std::vector<std::vector<std::string>> rows = {};
  std::size_t texts = 1;  ///< so many first columns stand left
  bool remarks = false;   ///< the last one too
};
[[nodiscard]] std::string html_of(const TextTable& table);

class Page {
 public:
  /// Throws `Error` (failed) on close() where it cannot be written.
  Page(const std::string& path, const std::string& title);
  /// The title, `what` was run, date, machine and verdict of a summary.
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
