#include "lab/stability/map.hpp"

#include "io/results/json.hpp"
#include "lab/page/engine_choice.hpp"
#include "lab/stability/plan.hpp"
#include "lab/stability/run.hpp"
#include "lab/stability/summary.hpp"
#include "report/page.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace subworld {

namespace {

/// Bounds of error over tolerance with colours. Blue passes, red misses, also for colour-blind readers.
struct Shade {
  double up_to;
  const char* colour;
  const char* ink;
  const char* means;
};
constexpr double kEndless = std::numeric_limits<double>::infinity();
constexpr std::array kShades{
    Shade{0.01, "#6baed6", "#000", "up to 0.01"},    Shade{0.1, "#9ecae1", "#000", "0.01 to 0.1"},
    Shade{0.5, "#c6dbef", "#000", "0.1 to 0.5"},     Shade{1.0, "#e7f0fa", "#000", "0.5 to 1: passes"},
    Shade{2.0, "#fee3c8", "#000", "1 to 2: misses"}, Shade{10.0, "#fdae6b", "#000", "2 to 10"},
    Shade{100.0, "#e6550d", "#fff", "10 to 100"},    Shade{kEndless, "#7f2704", "#fff", "more, or not measurable"}};

constexpr int kCell = 58, kLine = 20, kLabel = 350, kExpected = 100, kHeadLines = 3;

const Shade& shade_of(double margin) {
  return *std::ranges::find_if(kShades, [&](const Shade& shade) { return !(margin > shade.up_to); });
}

/// An engine, a preset and a step.
struct ColumnOf {
  std::string engine;
  std::string preset;
  double step_s;
  friend bool operator==(const ColumnOf&, const ColumnOf&) = default;
};
ColumnOf column_of(const Json& row) { return {row.at("engine"), row.at("preset"), number(row, "step_s")}; }

template <class T>
std::size_t place_in(std::vector<T>& list, const T& one) {
  const auto at = static_cast<std::size_t>(std::ranges::find(list, one) - list.begin());
  if (at == list.size()) list.push_back(one);
  return at;
}

std::string text_at(double x, double y, const std::string& text, const char* more = "") {
  return fmt::format("<text x=\"{:g}\" y=\"{:g}\" {}>{}</text>\n", x, y, more, escaped(text));
}

std::string begin(int width, int height) {
  return fmt::format(
      "<svg viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" font-family=\"sans-serif\" font-size=\"11\">\n", width,
      height);
}

/// A name above all consecutive columns that share it.
std::string head_line(const std::vector<ColumnOf>& columns, int line,
                      const std::function<std::string(const ColumnOf&)>& name,
                      const std::function<bool(const ColumnOf&, const ColumnOf&)>& same) {
  std::string text;
  for (std::size_t from = 0, to = 0; from < columns.size(); from = to) {
    while (to < columns.size() && same(columns[from], columns[to])) ++to;
    const double left = kLabel + static_cast<double>(from) * kCell, right = kLabel + static_cast<double>(to) * kCell;
    text += text_at(0.5 * (left + right), kLine * (line + 0.7), name(columns[from]),
                    "text-anchor=\"middle\" fill=\"#333\"");
    text +=
        fmt::format("<line x1=\"{0:g}\" x2=\"{0:g}\" y1=\"{1}\" y2=\"100%\" stroke=\"#888\" stroke-width=\"{2:g}\"/>\n",
                    left, line * kLine,
                    line == 0   ? 1.5
                    : line == 1 ? 0.75
                                : 0.0);
  }
  return text;
}

/// "26.57 deg", ">= 100".
std::string expected_text(const Json& row) {
  const std::string compare = row.at("compare"), unit = row.at("unit");
  const char* sign = compare == "at least" ? ">= " : compare == "at most" ? "<= " : "";
  return fmt::format("{}{:.4g}{}{}", sign, number(row, "expected"), unit.empty() ? "" : " ", unit);
}

std::string cell(const Json& row, double x, double y) {
  const Shade& shade = shade_of(margin_of(row));
  const bool pass = row.at("pass");
  const std::string hint = fmt::format(
      "{} {} {} s: {} {} {}, expected {:.4g}, error over tolerance {:.3g} {}", label_of(row), setting_of(row),
      step_text(number(row, "step_s")), row.at("quantity").get<std::string>(), measured_text(row),
      row.at("unit").get<std::string>(), number(row, "expected"), margin_of(row), row.at("failure").get<std::string>());
  return fmt::format(
      "<g><title>{}</title><rect x=\"{:g}\" y=\"{:g}\" width=\"{}\" height=\"{}\" fill=\"{}\"/><text x=\"{:g}\" "
      "y=\"{:g}\" "
      "text-anchor=\"middle\" fill=\"{}\"{}>{}</text></g>\n",
      escaped(hint), x + 0.5, y + 0.5, kCell - 1, kLine - 1, shade.colour, x + 0.5 * kCell, y + 0.7 * kLine, shade.ink,
      pass ? "" : " font-weight=\"bold\"", escaped(measured_text(row)));
}

}  // namespace

std::string stability_legend() {
  constexpr int kWidth = 150;
  std::string text = begin(kWidth * static_cast<int>(kShades.size()), 2 * kLine);
  text += text_at(0, 0.7 * kLine, "Colour: error over tolerance. Number: what was measured; bold where it misses.");
  for (std::size_t i = 0; i < kShades.size(); ++i) {
    const double x = static_cast<double>(i) * kWidth;
    text += fmt::format("<rect x=\"{:g}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"{}\"/>\n", x, kLine, kWidth - 2,
                        kLine, kShades[i].colour);
    text += text_at(x + 0.5 * kWidth, 1.7 * kLine, kShades[i].means,
                    fmt::format("text-anchor=\"middle\" fill=\"{}\"", kShades[i].ink).c_str());
  }
  return text + "</svg>\n";
}

std::string stability_map(const Rows& all, const Rows& rows) {
  std::vector<ColumnOf> columns;
  for (const Json& row : all) place_in(columns, column_of(row));
  std::vector<std::string> labels, expected;
  std::string cells;
  for (const Json& row : rows) {
    const std::size_t line = place_in(labels, label_of(row));
    if (line == expected.size()) expected.push_back(expected_text(row));
    cells += cell(row, kLabel + static_cast<double>(place_in(columns, column_of(row))) * kCell,
                  static_cast<double>(line + kHeadLines) * kLine);
  }
  std::string text =
      begin(kLabel + static_cast<int>(columns.size()) * kCell, (static_cast<int>(labels.size()) + kHeadLines) * kLine);
  const auto same_engine = [](const ColumnOf& a, const ColumnOf& b) { return a.engine == b.engine; };
  const auto same_preset = [&](const ColumnOf& a, const ColumnOf& b) {
    return same_engine(a, b) && a.preset == b.preset;
  };
  text += cells;
  text += head_line(
      columns, 0, [](const ColumnOf& c) { return c.engine; }, same_engine);
  text += head_line(
      columns, 1, [](const ColumnOf& c) { return c.preset; }, same_preset);
  text += head_line(
      columns, 2, [](const ColumnOf& c) { return step_text(c.step_s) + " s"; }, std::equal_to<>());
  text += text_at(kLabel - 8, 2.7 * kLine, "expected", "text-anchor=\"end\" fill=\"#333\"");
  for (std::size_t i = 0; i < labels.size(); ++i) {
    const double y = kLine * (static_cast<double>(i) + kHeadLines + 0.7);
    text += text_at(kLabel - kExpected, y, labels[i], "text-anchor=\"end\"");
    text += text_at(kLabel - 8, y, expected[i], "text-anchor=\"end\" fill=\"#555\"");
  }
  return text + "</svg>\n";
}

}  // namespace subworld
