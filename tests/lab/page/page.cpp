#include "lab/page/page.hpp"

#include "model/error.hpp"

#include <fmt/format.h>

#include <cmath>

namespace subworld {

namespace {

constexpr const char* kHead = R"(<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<style>
body { font: 15px/1.5 sans-serif; color: #222; background: #fff; max-width: 1500px; margin: 2em auto; padding: 0 1.5em; }
h1 { font-size: 1.6em; margin-bottom: 0.2em; } h2 { margin-top: 2.2em; border-bottom: 2px solid #0072b2; }
p { max-width: 70em; } .facts { color: #555; }
.plots { display: grid; grid-template-columns: repeat(auto-fit, minmax(520px, 1fr)); gap: 1em; }
.plots svg { width: 100%; height: auto; border: 1px solid #ddd; border-radius: 4px; }
.wide { overflow-x: auto; } table { border-collapse: collapse; font-size: 0.85em; font-variant-numeric: tabular-nums; }
th, td { padding: 0.2em 0.6em; border-bottom: 1px solid #e4e4e4; text-align: right; white-space: nowrap; }
th { background: #f2f5f8; vertical-align: bottom; white-space: normal; } .text { text-align: left; }
.dominated td { color: #767676; background: #fafafa; } .good { color: #00704f; font-weight: bold; }
.doubt { background: #fdf6e3; padding: 0.5em 1em; border-left: 4px solid #b8860b; }
.choice { background: #eef7f3; padding: 0.5em 1em; border-left: 4px solid #009e73; }
</style>
)";

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
  return digits_of(column.scale * value->get<double>(), column.digits);
}

std::string html_of(const TextTable& table) {
  const auto line = [&](const char* tag, const std::vector<std::string>& cells) {
    std::string text = "<tr>";
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const bool left = i < table.texts || (table.remarks && i + 1 == table.head.size());
      text += fmt::format("<{}{}>{}</{}>", tag, left ? " class=text" : "", cells[i], tag);
    }
    return text + "</tr>\n";
  };
  std::string text = "<div class=wide><table>" + line("th", table.head);
  for (const auto& row : table.rows) text += line("td", row);
  return text + "</table></div>\n";
}

std::string digits_of(double number, int digits) {
  if (!std::isfinite(number)) return "&ndash;";
  const bool whole = std::abs(number) >= std::pow(10.0, digits) && std::abs(number) < kLongestWhole;
  return whole ? fmt::format("{:.0f}", number) : fmt::format("{:.{}g}", number, digits);
}

Page::Page(const std::string& path, const std::string& title) : path_(path), title_(title), file_(path) {
  file_ << kHead << "<title>" << escaped(title) << "</title></head><body>\n";
}

void Page::intro(const std::string& what, const Json& summary) {
  const Json& machine = summary.at("machine");
  file_ << fmt::format(
      "<h1>{}</h1>\n<p class=facts>{}<br>{} &middot; {}, {} cores, {} {}, compiler {}<br>Verdict: {}</p>\n",
      escaped(title_), escaped(what), summary.at("date").get<std::string>(),
      escaped(machine.at("cpu").get<std::string>()), machine.at("cores").get<int>(),
      machine.at("system").get<std::string>(), machine.at("kernel").get<std::string>(),
      escaped(machine.at("compiler").get<std::string>()), escaped(summary.at("verdict").get<std::string>()));
}

void Page::plots(const std::string* first, std::size_t count) {
  file_ << "<div class=plots>\n";
  for (std::size_t i = 0; i < count; ++i) file_ << "<div>" << first[i] << "</div>\n";
  file_ << "</div>\n";
}

void Page::close() {
  file_ << "</body></html>\n";
  if (!file_.flush()) throw Error(ExitCode::failed, fmt::format("{}: cannot write; is the disk full?", path_));
}

}  // namespace subworld
