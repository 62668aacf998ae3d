#include "lab/over_link/over_link.hpp"

#include "io/results/json.hpp"
#include "lab/over_link/run_program.hpp"
#include "link/network.hpp"
#include "model/error.hpp"
#include "model/places.hpp"
#include "rt/stop.hpp"
#include "support/temporary_folder.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace subworld {

namespace {

/// The session file of a run: the world on a host, and each user on one.
std::string session_text(const Point& point, const Scene& scene, const OverLink& over) {
  std::string text = fmt::format("name: over_link\nscene: {}\ndds: {}\ndomain: {}\nlink: {}\n",
                                 std::filesystem::absolute(point.scene).string(), over.dds, over.domain, over.link);
  text += fmt::format("flags: {{mode: realtime, duration: {}, scheme: {}", scene.settings.duration_s,
                      scene.settings.scheme);
  if (point.ratio > 0) text += fmt::format(", ratio: {}", point.ratio);
  std::string set;
  for (const SettingChange& one : point.settings) {
    if (one.key.starts_with("delay.")) continue;  // the link has it
    set += fmt::format("{}\"{}={}\"", set.empty() ? "" : ", ", one.key, one.value);
  }
  if (!set.empty()) text += fmt::format(", set: [{}]", set);
  text += "}\nhosts:\n  - name: world\n    programs: [world_sim]\n";
  const std::string vendor = over.users_dds.empty() ? "" : fmt::format("    dds: {}\n", over.users_dds);
  for (int user = 0; user < scene.settings.users; ++user)
    text += fmt::format("  - name: user_{0}\n{1}    programs: [haptic_sim {0}, device_sim {0}]\n", user, vendor);
  return text;
}

/// What a haptic process writes of each step.
struct HapticHistory {
  DeviceClock clock;
  std::vector<Vec3> force, on_operator;  ///< N
};

/// Of the file's first columns, those that are read here.
constexpr const char* kColumns =
    "time_s,force_x_n,force_y_n,force_z_n,operator_force_x_n,operator_force_y_n,operator_force_z_n,torque_x_n_m,"
    "torque_y_n_m,torque_z_n_m,proxy_x_m,proxy_y_m,proxy_z_m,device_x_m,device_y_m,device_z_m,device_time_s,";
constexpr std::size_t kTime = 0, kForce = 1, kOnOperator = 4, kDeviceTime = 16;

HapticHistory read_history(const std::string& file, double h_s) {
  std::ifstream in(file);
  HapticHistory history;
  std::string line;
  std::getline(in, line);
  if (!line.starts_with(kColumns)) throw Error(ExitCode::failed, file + ": is not a history of this version");
  while (std::getline(in, line)) {
    std::array<double, kDeviceTime + 1> row{};
    const char* at = line.c_str();
    for (double& value : row) {
      char* end = nullptr;
      value = std::strtod(at, &end);
      at = *end == ',' ? end + 1 : end;
    }
    const double begin_s = row[kTime] - h_s;  // a row has the time at the end of its step
    if (!history.force.empty() && begin_s <= history.clock.time_s.back()) continue;
    history.clock.time_s.push_back(begin_s);
    history.clock.device_s.push_back(row[kDeviceTime]);
    history.force.emplace_back(row[kForce], row[kForce + 1], row[kForce + 2]);
    history.on_operator.emplace_back(row[kOnOperator], row[kOnOperator + 1], row[kOnOperator + 2]);
  }
  if (history.force.empty()) throw Error(ExitCode::failed, file + ": has no step");
  return history;
}

/// Linear in time between the entries, constant before the first and behind the last.
Vec3 at_time(const std::vector<double>& time_s, const std::vector<Vec3>& values, double t_s) noexcept {
  const auto after = std::ranges::upper_bound(time_s, t_s);
  if (after == time_s.begin()) return values.front();
  if (after == time_s.end()) return values.back();
  const auto i = static_cast<std::size_t>(after - time_s.begin());
  const double part = (t_s - time_s[i - 1]) / (time_s[i] - time_s[i - 1]);
  return values[i - 1] + part * (values[i] - values[i - 1]);
}

/// Before the end of a history, in which the force fades.
constexpr double kEnding_s = 0.1;

/// On the reference's steps, as far as the history reaches without its end.
FeltHistory on_steps(const HapticHistory& history, std::size_t steps, double h_s) {
  FeltHistory felt;
  for (std::size_t i = 0; i < steps; ++i) {
    const double t_s = static_cast<double>(i) * h_s;
    if (t_s > history.clock.time_s.back() - kEnding_s) break;
    felt.force.push_back(at_time(history.clock.time_s, history.force, t_s));
    felt.on_operator.push_back(at_time(history.clock.time_s, history.on_operator, t_s));
  }
  return felt;
}

/// The reference, with the paths of its users as they were.
Scene with_motions(const Point& point, const std::vector<HapticHistory>& histories) {
  Scene scene = reference_scene_of(point);
  for (std::size_t user = 0; user < histories.size(); ++user) {
    for (PathSegment& segment : scene.users[user].device.path) {
      segment.from_s = histories[user].clock.time_of(segment.from_s);
      if (std::isfinite(segment.to_s)) segment.to_s = histories[user].clock.time_of(segment.to_s);
    }
  }
  return scene;
}

/// The launcher's last lines, which name the fault.
std::string end_of_text(const std::string& text) {
  constexpr std::size_t kMost = 1000;
  return text.size() <= kMost ? text : text.substr(text.find('\n', text.size() - kMost) + 1);
}

/// Of the haptic processes and of the world.
double late_steps(const Json& summary) {
  double late = summary.at("world").at("late_cycles");
  for (const Json& user : summary.at("haptic")) late += user.at("missed_deadlines").get<double>();
  return late;
}

/// The first gate that this machine missed. Those of the network, the scene and the engine another run would miss too.
std::string disturbance_of(const Json& summary) {
  for (const Json& gate : summary.at("gates")) {
    if (gate.at("ok") || (gate.at("missed_by") != "os" && gate.at("missed_by") != "run")) continue;
    return fmt::format("{} {:.3g} {}", gate.at("name").get<std::string>(), gate.at("value").get<double>(),
                       gate.at("unit").get<std::string>());
  }
  return {};
}

}  // namespace

void require_link_rights() {
  EmulatedNetwork network;
  for (const char* host : {"a", "b"}) network.add_host(host);
  network.set_links({});
  network.start();
}

double DeviceClock::time_of(double device_time_s) const noexcept {
  const auto after = std::ranges::upper_bound(device_s, device_time_s);
  if (after == device_s.begin()) return std::max(0.0, time_s.front() + device_time_s - device_s.front());
  if (after == device_s.end()) return time_s.back() + device_time_s - device_s.back();
  const auto i = static_cast<std::size_t>(after - device_s.begin());
  const double part = (device_time_s - device_s[i - 1]) / (device_s[i] - device_s[i - 1]);
  return time_s[i - 1] + part * (time_s[i] - time_s[i - 1]);
}

std::optional<LinkedRun> run_over_link(const Point& point, const OverLink& over) {
  const Scene scene = scene_of(point);
  const TemporaryFolder folder;
  const std::string session = folder.write("over_link.yaml", session_text(point, scene, over));
  const std::string out = folder.path() + "/out";
  const std::string launcher = (program_folder() / "subworld").string();
  const Finished ended = run_program({launcher, "up", session, "--namespaces", "--out", out}, nullptr);
  if (stop_signal() != 0) return std::nullopt;
  if (ended.code != 0)
    throw Error(ExitCode::failed, fmt::format("the run over the link {} ended with exit code {}:\n{}", over.link,
                                              ended.code, end_of_text(ended.text)));
  LinkedRun run;
  run.summary = read_json(out + "/summary.json");
  std::vector<HapticHistory> histories;
  const double h_s = scene.settings.h_s;
  for (int user = 0; user < scene.settings.users; ++user)
    histories.push_back(read_history(fmt::format("{}/haptic_{}.csv", out, user), h_s));
  std::optional<Outcome> reference = run_out(with_motions(point, histories));
  if (!reference) return std::nullopt;
  run.reference = std::move(*reference);
  for (std::size_t user = 0; user < histories.size(); ++user) {
    run.start_s.push_back(histories[user].clock.time_of(0.0));
    run.felt.push_back(on_steps(histories[user], run.reference.felt[user].force.size(), h_s));
  }
  return run;
}

std::optional<LinkedRun> undisturbed_run_over_link(const Point& point, const OverLink& over) {
  constexpr int kAttempts = 4;
  std::optional<LinkedRun> best;
  for (int attempt = 1; attempt <= kAttempts; ++attempt) {
    std::optional<LinkedRun> run = run_over_link(point, over);
    if (!run) return run;
    run->disturbed = disturbance_of(run->summary);
    const bool ok = run->disturbed.empty();
    if (!best || ok || late_steps(run->summary) < late_steps(best->summary)) best = std::move(run);
    best->attempts = attempt;
    if (ok) break;
  }
  return best;
}

}  // namespace subworld
