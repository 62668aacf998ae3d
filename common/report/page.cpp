#include "report/page.hpp"

#include "io/results/json.hpp"
#include "io/results/replacing.hpp"
#include "io/version.hpp"
#include "model/error.hpp"
#include "report/look.hpp"

#include <fmt/core.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>

namespace subworld {

namespace {

constexpr double kLongestWhole = 1e7;

}  // namespace

std::string escaped(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    switch (c) {
      case '&':
        safe += "&amp;";
        break;
      case '<':
        safe += "&lt;";
        break;
      case '>':
        safe += "&gt;";
        break;
      case '"':
        safe += "&quot;";
        break;
      default:
        safe += c;
    }
  }
  return safe;
}

std::string cell_of(const Column& column, const Json& row) {
  const Json* value = &row.at(column.key);
  if (column.inner != nullptr) value = &value->at(column.inner);
  if (value->is_string()) return escaped(*value);
  if (value->is_null()) return "&ndash;";
  return shown(column.scale * value->get<double>(), column.digits);
}

std::string html_of(const TextTable& table) {
  const auto line = [&](const char* tag, const std::vector<std::string>& cells, const std::vector<std::string>& about) {
    std::string text = "<tr>";
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const bool left = i < table.texts || (table.remarks && i + 1 == table.head.size());
      const std::string hint =
          i < about.size() && !about[i].empty() ? fmt::format(" title=\"{}\"", escaped(about[i])) : "";
      text += fmt::format("<{}{}{}>{}</{}>", tag, left ? " class=text" : "", hint, cells[i], tag);
    }
    return text + "</tr>\n";
  };
  const std::string name = table.name.empty() ? "" : fmt::format(" data-name=\"{}\"", escaped(table.name));
  std::string text = fmt::format("<div class=wide><table{}>{}", name, line("th", table.head, table.about));
  for (const auto& row : table.rows) text += line("td", row, {});
  return text + "</table></div>\n";
}

std::string html_of(const std::vector<std::pair<std::string, std::string>>& facts) {
  std::string text = "<dl class=what>\n";
  for (const auto& [name, what] : facts) text += fmt::format("<dt>{}</dt><dd>{}</dd>\n", name, what);
  return text + "</dl>\n";
}

std::string digits_of(double number, int digits) {
  if (!std::isfinite(number)) return "&ndash;";
  const bool whole = std::abs(number) >= std::pow(10.0, digits) && std::abs(number) < kLongestWhole;
  return whole ? fmt::format("{:.0f}", number) : fmt::format("{:.{}g}", number, digits);
}

std::string shown(double number, int digits) {
  if (!std::isfinite(number)) return digits_of(number, digits);
  return fmt::format("<data value=\"{}\">{}</data>", number, digits_of(number, digits));
}

void check_page(const std::string& path) {
  std::error_code none;
  if (!std::filesystem::is_regular_file(path, none) || std::filesystem::is_empty(path, none) || has_mark(path)) return;
  throw Error(ExitCode::usage, fmt::format("{}: holds something else, which the page would replace; choose another "
                                           "name (--out), or remove it",
                                           path));
}

Page::Page(const std::string& path, const std::string& title) : path_(path), title_(title) {
  text_ = fmt::format("{}<title>{}</title></head><body>\n", page_head(), escaped(title));
}

void Page::intro(const std::string& what, const Json& summary) {
  const Json& machine = summary.at("machine");
  title();
  text_ += fmt::format(
      "<p class=facts>{}<br>{} &middot; {}, {} cores, {} {}, compiler {}</p>\n<p class=\"verdict plain\">{}</p>\n",
      escaped(what), summary.at("date").get<std::string>(), escaped(machine.at("cpu").get<std::string>()),
      machine.at("cores").get<int>(), machine.at("system").get<std::string>(), machine.at("kernel").get<std::string>(),
      escaped(machine.at("compiler").get<std::string>()), escaped(summary.at("verdict").get<std::string>()));
}

void Page::plots(const std::string* first, std::size_t count) {
  text_ += "<div class=plots>\n";
  for (std::size_t i = 0; i < count; ++i) text_ += "<div>" + first[i] + "</div>\n";
  text_ += "</div>\n";
}

void Page::close() {
  std::ofstream file(path_);
  if (!file) throw Error(ExitCode::failed, fmt::format("{}: {}; choose another file", path_, std::strerror(errno)));
  file << text_ << fmt::format("<p class=facts>{} {}.</p>\n", kOwnMark, version_text()) << page_script()
       << "</body></html>\n";
  if (!file.flush()) throw Error(ExitCode::failed, fmt::format("{}: cannot write; is the disk full?", path_));
}

}  // namespace subworld
