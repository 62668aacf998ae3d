#pragma once

#include "io/results/results.hpp"
#include "report/plots.hpp"

#include <string>
#include <utility>
#include <vector>

/// A report as one self-contained page.
namespace subworld {

/// `lab_NAME --write-report DIR PAGE` writes the page of a lab again, from the tables in its folder.
inline constexpr const char* kWriteReport = "--write-report";

/// The text with the characters of HTML's syntax replaced, also for attributes between double quotes.
[[nodiscard]] std::string escaped(const std::string& text);

/// The number with these significant digits, or a dash if it is not a number.
[[nodiscard]] std::string digits_of(double number, int digits);
/// The same as an element that holds the exact number too, by which a table is sorted and saved.
[[nodiscard]] std::string shown(double number, int digits);

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
  std::size_t texts = 1;                ///< number of first columns with text, left-aligned
  bool remarks = false;                 ///< the last column is text too
  std::string name = {};                ///< of the file in which a reader saves it; empty: a number
  std::vector<std::string> about = {};  ///< of the columns: what each means, not escaped
};
[[nodiscard]] std::string html_of(const TextTable& table);
/// A list of names and what they are (already escaped).
[[nodiscard]] std::string html_of(const std::vector<std::pair<std::string, std::string>>& facts);

/// Throws `Error` (usage) where a page would replace a file that is none.
void check_page(const std::string& path);

/// The file is written by close(), as a whole.
class Page {
 public:
  Page(const std::string& path, const std::string& title);
  /// As the first heading.
  void title() { text_ += "<h1>" + escaped(title_) + "</h1>\n"; }
  /// Title, `what` was run, date, machine and verdict of a summary.
  void intro(const std::string& what, const Json& summary);
  void add(const std::string& html) { text_ += html; }
  void heading(const std::string& text) { text_ += "<h2>" + escaped(text) + "</h2>\n"; }
  /// Side by side.
  void plots(const std::string* first, std::size_t count);
  /// Throws `Error` (failed) if the file cannot be written.
  void close();

 private:
  std::string path_;
  std::string title_;
  std::string text_;
};

}  // namespace subworld
