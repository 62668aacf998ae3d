#include "report/plots.hpp"

#include "io/results/output.hpp"
#include "model/error.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <regex>

namespace subworld {

namespace {

constexpr double kDecadesOfFineTicks = 1.6;
constexpr std::size_t kHeight = 450;     ///< pixels, with a legend of few lines
constexpr std::size_t kLegendLine = 18;  ///< pixels
constexpr std::size_t kFreeLines = 4;

class WorkFolder {
 public:
  WorkFolder() {
    std::string name = temporary_folder() + "/subworld-plots-XXXXXX";
    if (mkdtemp(name.data()) == nullptr)
      throw Error(ExitCode::failed, fmt::format("{}: cannot create the folder: {}", name, std::strerror(errno)));
    path_ = name;
  }
  ~WorkFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;
  [[nodiscard]] std::string file(const std::string& name) const { return (path_ / name).string(); }
  [[nodiscard]] std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

std::string text_of(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  void add(double v) {
    low = std::min(low, v);
    high = std::max(high, v);
  }
};

/// Range and ticks of a logarithmic axis: powers of ten, with 2 and 5 between them if there are few.
std::string log_axis(char axis, const Range& range, const std::vector<double>& ticks) {
  std::string text = fmt::format("set logscale {}\n", axis);
  if (!(range.low > 0.0)) return text;
  const double low = range.low / 1.25, high = range.high * 1.25;
  text += fmt::format("set {}range [{:g}:{:g}]\n", axis, low, high);
  std::vector<double> at = ticks;
  if (at.empty()) {
    const bool fine = std::log10(high / low) < kDecadesOfFineTicks;
    for (int k = -12; k <= 12; ++k) {
      for (const double digit : {1.0, 2.0, 5.0}) {
        if (fine || digit == 1.0) at.push_back(digit * std::pow(10.0, k));
      }
    }
  }
  std::erase_if(at, [&](double tick) { return tick < low || tick > high; });
  std::string list;
  for (const double tick : at) list += fmt::format("{}\"{:g}\" {:g}", list.empty() ? "" : ", ", tick, tick);
  return text + fmt::format("set {}tics ({})\n", axis, list);
}

/// The text as a string of gnuplot, which would run what stands between backquotes.
std::string as_string(const std::string& text) {
  std::string string = "\"";
  for (const char c : text) {
    if (c == '\n') {
      string += "\\n";
      continue;
    }
    if (c == '"' || c == '\\' || c == '`') string += '\\';
    string += c;
  }
  return string + '"';
}

/// Of a tick: gnuplot reads it as a format of the number.
std::string as_tick(std::string text) {
  for (std::size_t at = text.find('%'); at != std::string::npos; at = text.find('%', at + 2)) text.insert(at, 1, '%');
  return as_string(text);
}

/// Range and ticks of an axis with a name for each whole number.
std::string named_axis(const std::vector<std::string>& names) {
  std::string list;
  for (std::size_t i = 0; i < names.size(); ++i)
    list += fmt::format("{}{} {}", list.empty() ? "" : ", ", as_tick(names[i]), i + 1);
  return fmt::format("set xrange [0.7:{}.3]\nset xtics ({})\nset xlabel offset 0,-1\nset bmargin 5\n", names.size(),
                     list);
}

std::string script_of(const Plot& plot, std::size_t number) {
  std::string text = fmt::format(
      "reset\nset term svg size 720,{} dynamic noenhanced background 'white' font 'sans-serif,13'\nset output "
      "'plot{}.svg'\nset title {}\nset xlabel {}\nset ylabel {}\n"
      "set grid back lc rgb '#dddddd' lw 0.6 dt 1\nset border 3 lc rgb '#888888'\nset tics nomirror\n"
      "set key tmargin center horizontal samplen 2\nset datafile missing 'x'\n",
      kHeight + kLegendLine * std::max<std::size_t>(plot.series.size(), kFreeLines) - kLegendLine * kFreeLines, number,
      as_string(plot.title), as_string(plot.x_label), as_string(plot.y_label));
  Range x, y;
  std::string data, curves;
  for (std::size_t s = 0; s < plot.series.size(); ++s) {
    const Series& series = plot.series[s];
    std::string lines;
    for (const auto& [a, b] : series.points) {
      if (!std::isfinite(a) || !std::isfinite(b) || (plot.log_x && a <= 0.0) || (plot.log_y && b <= 0.0)) continue;
      x.add(a);
      y.add(b);
      lines += fmt::format("{:.7g} {:.7g}\n", a, b);
    }
    if (lines.empty()) continue;
    data += fmt::format("$data{} << EOD\n{}EOD\n", s, lines);
    curves +=
        fmt::format("{}$data{} using 1:2 with {} lc rgb '{}' lw {} dt {}{} title {}", curves.empty() ? "" : ", ", s,
                    series.mark > 0 ? "linespoints" : "lines", series.colour, series.width, series.dashed ? 2 : 1,
                    series.mark > 0 ? fmt::format(" pt {} ps 0.8", series.mark) : "", as_string(series.title));
  }
  if (curves.empty()) {
    data = "set label 1 \"nothing to draw\" at graph 0.5,0.5 center\nset xrange [0:1]\nset yrange [0:1]\n";
    curves = "NaN notitle";
    return text + data + "plot " + curves + "\n";
  }
  for (const Level& level : plot.levels) {
    if (!std::isfinite(level.value) || (plot.log_y && level.value <= 0.0)) continue;
    y.add(level.value);
    curves += fmt::format(", {:g} with lines lc rgb '{}' lw 1.5 dt 2 title {}", level.value, level.colour,
                          as_string(level.title));
  }
  if (plot.tight_x) text += "set autoscale xfixmax\n";
  if (plot.log_x) text += log_axis('x', x, plot.x_ticks);
  if (plot.log_y) text += log_axis('y', y, {});
  if (!plot.x_names.empty()) text += named_axis(plot.x_names);
  return text + data + "plot " + curves + "\n";
}

/// The SVG element only, without prologue and without titles, which a browser would show as tooltips.
std::string element_of(const std::string& file) {
  const auto begin = file.find("<svg");
  if (begin == std::string::npos) throw Error(ExitCode::failed, "gnuplot wrote no picture; is it built with svg?");
  static const std::regex kHint("<(title|desc)>[^<]*</(title|desc)>");
  return std::regex_replace(file.substr(begin), kHint, "");
}

}  // namespace

std::vector<std::string> svg_of(const std::vector<Plot>& plots) {
  const WorkFolder folder;
  {
    std::ofstream script(folder.file("plots.gp"));
    for (std::size_t i = 0; i < plots.size(); ++i) script << script_of(plots[i], i);
    script << "set output\n";
  }
  const std::string command = fmt::format("cd {} && gnuplot plots.gp 2>errors.txt", shell_word(folder.path()));
  const int status = std::system(command.c_str());
  if (WIFEXITED(status) && WEXITSTATUS(status) == 127) {
    throw Error(ExitCode::failed,
                "gnuplot is missing, so there is no report.html; install it (apt-get install gnuplot-nox)");
  }
  if (status != 0) throw Error(ExitCode::failed, fmt::format("gnuplot failed: {}", text_of(folder.file("errors.txt"))));
  std::vector<std::string> pictures;
  for (std::size_t i = 0; i < plots.size(); ++i)
    pictures.push_back(element_of(text_of(folder.file(fmt::format("plot{}.svg", i)))));
  return pictures;
}

}  // namespace subworld
