#include "io/records/history_reader.hpp"
#include "io/results/json.hpp"
#include "results/envelope.hpp"
#include "results/run_report.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>

namespace subworld {

namespace {

constexpr std::array kUserColours{"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                  "#56b4e9", "#e69f00", "#8c6bb1", "#8a8a8a"};
constexpr const char* kLimitColour = "#b8860b";
constexpr double kLineWidth = 1.2;
constexpr const char* kTime = "simulated time, s";

/// Curves of a user; those of time are in ms.
struct UserCurves {
  std::string name;
  Envelope force_n, step_ms, lateness_ms, late;
};

UserCurves curves_of(const std::string& file, const std::string& name, double h_s) {
  UserCurves curves{.name = name, .force_n = {}, .step_ms = {}, .lateness_ms = {}, .late = {}};
  HistoryReader rows(file);
  const auto time = rows.find("time_s"), x = rows.find("operator_force_x_n"), y = rows.find("operator_force_y_n"),
             z = rows.find("operator_force_z_n"), step = rows.find("step_s"), lateness = rows.find("lateness_s");
  if (!time) return curves;
  double late = 0.0;
  while (rows.next()) {
    const double t = rows.value(*time);
    if (x && y && z) curves.force_n.add(t, std::hypot(rows.value(*x), rows.value(*y), rows.value(*z)));
    if (step) curves.step_ms.add(t, 1e3 * rows.value(*step));
    if (lateness) curves.lateness_ms.add(t, 1e3 * rows.value(*lateness));
    if (step && lateness && rows.value(*step) + rows.value(*lateness) > h_s) late += 1.0;
    curves.late.add(t, late);
  }
  return curves;
}

struct WorldCurves {
  Envelope kinetic_j, potential_j, excess_j, step_ms, factor, ratio;
};

WorldCurves world_curves(const std::string& file) {
  WorldCurves curves;
  HistoryReader rows(file);
  const auto time = rows.find("time_s");
  if (!time) return curves;
  const auto add = [&](Envelope& to, const char* column, double scale, double offset) {
    if (const auto place = rows.find(column)) to.add(rows.value(*time), scale * (rows.value(*place) - offset));
  };
  std::optional<double> potential_j;
  while (rows.next()) {
    if (!potential_j) potential_j = rows.at("potential_energy_j");
    add(curves.kinetic_j, "kinetic_energy_j", 1.0, 0.0);
    add(curves.potential_j, "potential_energy_j", 1.0, *potential_j);
    add(curves.excess_j, "energy_excess_j", 1.0, 0.0);
    add(curves.step_ms, "step_s", 1e3, 0.0);
    add(curves.factor, "real_time_factor", 1.0, 0.0);
    add(curves.ratio, "ratio", 1.0, 0.0);
  }
  return curves;
}

Series line_of(const std::string& title, std::size_t colour, const Envelope& curve) {
  return {.title = title,
          .colour = kUserColours[colour % kUserColours.size()],
          .width = kLineWidth,
          .mark = 0,
          .points = curve.points()};
}

Plot plot_of(const std::string& title, const std::string& y_label) {
  return {
      .title = title, .x_label = kTime, .y_label = y_label, .tight_x = true, .x_ticks = {}, .series = {}, .levels = {}};
}

/// One plot for at most as many users as there are colours.
void add_user_plots(std::vector<Plot>& plots, const std::vector<UserCurves>& users, const Plot& like,
                    const Envelope UserCurves::*curve) {
  for (std::size_t first = 0; first < users.size(); first += kUserColours.size()) {
    Plot plot = like;
    const std::size_t end = std::min(users.size(), first + kUserColours.size());
    for (std::size_t u = first; u < end; ++u) {
      if (!(users[u].*curve).empty()) plot.series.push_back(line_of(users[u].name, u, users[u].*curve));
    }
    if (users.size() > kUserColours.size())
      plot.title += fmt::format(", {} to {} of {} users", first + 1, end, users.size());
    if (!plot.series.empty()) plots.push_back(std::move(plot));
  }
}

void add_energy_plot(std::vector<Plot>& plots, const WorldCurves& world) {
  Plot plot = plot_of("Energy of the bodies", "energy, J");
  if (!world.kinetic_j.empty()) plot.series.push_back(line_of("kinetic", 0, world.kinetic_j));
  if (!world.potential_j.empty())
    plot.series.push_back(line_of("potential, from its first value", 1, world.potential_j));
  if (!world.excess_j.empty()) plot.series.push_back(line_of("gained beyond the work of the users", 2, world.excess_j));
  if (!plot.series.empty()) plots.push_back(std::move(plot));
}

void add_world_times(std::vector<Plot>& plots, const WorldCurves& world, const Json& summary, bool realtime) {
  if (world.step_ms.largest() > 0.0) {
    Plot plot = plot_of("Time of a cycle of the world", "work, ms");
    plot.log_y = true;
    plot.series = {line_of("world", 0, world.step_ms)};
    const double ratio = number_at(summary, "ratio");
    if (realtime && ratio == number_at(summary, "ratio_most"))
      plot.levels = {{"length of a cycle", kLimitColour, 1e3 * ratio * number_at(summary, "h_s")}};
    plots.push_back(std::move(plot));
  }
  constexpr double kAsGoodAsOne = 0.999;
  if (number_at(summary, "world/real_time_factor_min") < kAsGoodAsOne && !world.factor.empty()) {
    plots.push_back(plot_of("Simulated time over wall time", "real-time factor"));
    plots.back().series = {line_of("world", 0, world.factor)};
  }
  if (number_at(summary, "world/ratio_changes") > 0.0 && !world.ratio.empty()) {
    plots.push_back(plot_of("Simulation ratio", "ratio"));
    plots.back().series = {line_of("world", 0, world.ratio)};
  }
}

constexpr std::uintmax_t kLargest_bytes = 8 << 20;
constexpr std::size_t kMostPictures = 12;

std::string base64(const std::string& bytes) {
  constexpr const char* kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t three = 0;
    for (std::size_t k = 0; k < 3; ++k)
      three = three << 8 | (i + k < bytes.size() ? static_cast<std::uint8_t>(bytes[i + k]) : 0U);
    for (std::size_t k = 0; k < 4; ++k) text += i + k > bytes.size() ? '=' : kDigits[three >> (18 - 6 * k) & 63];
  }
  return text;
}

/// Empty if the file is no picture.
std::string png_of(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(stream), {}};
  return bytes.starts_with("\x89PNG\r\n\x1a\n") ? bytes : "";
}

}  // namespace

std::vector<Plot> plots_of_run(const Json& summary, const std::vector<Json>& users, const std::string& folder) {
  const double h_s = number_at(summary, "h_s");
  const bool realtime = text_at(summary, "mode") == "realtime";
  std::vector<UserCurves> curves;
  for (const Json& user : users) {
    const std::string number = text_at(user, "user");
    curves.push_back(curves_of(fmt::format("{}/haptic_{}.csv", folder, number), text_at(user, "name"), h_s));
  }
  const WorldCurves world = world_curves(folder + "/world.csv");
  std::vector<Plot> plots;
  add_user_plots(plots, curves, plot_of("Force on the operator", "force, N"), &UserCurves::force_n);
  add_energy_plot(plots, world);
  Plot step = plot_of("Time of a haptic step", "work, ms");
  step.log_y = true;
  if (realtime) step.levels = {{"haptic step", kLimitColour, 1e3 * h_s}};
  add_user_plots(plots, curves, step, &UserCurves::step_ms);
  add_world_times(plots, world, summary, realtime);
  if (!realtime) return plots;
  add_user_plots(plots, curves, plot_of("Late steps: ended after their period", "steps until then"), &UserCurves::late);
  add_user_plots(plots, curves, plot_of("Lateness: delay of the start of a step", "lateness, ms"),
                 &UserCurves::lateness_ms);
  return plots;
}

std::string pictures_in(const std::string& folder) {
  std::vector<std::filesystem::path> files;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored)) {
    if (entry.path().extension() == ".png" && entry.is_regular_file() && entry.file_size() <= kLargest_bytes)
      files.push_back(entry.path());
  }
  std::ranges::sort(files);
  if (files.size() > kMostPictures) files.resize(kMostPictures);
  std::string text;
  for (const std::filesystem::path& file : files) {
    const std::string png = png_of(file), name = escaped(file.filename().string());
    if (png.empty()) continue;
    text +=
        fmt::format("<figure><img alt=\"{}\" src=\"data:image/png;base64,{}\"><figcaption>{}</figcaption></figure>\n",
                    name, base64(png), name);
  }
  return text.empty() ? text : "<div class=pictures>\n" + text + "</div>\n";
}

}  // namespace subworld
