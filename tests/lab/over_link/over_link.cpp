#include "lab/over_link/over_link.hpp"

#include "link/host.hpp"
#include "model/error.hpp"
#include "rt/stop.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>

namespace subworld {

namespace {

/// A folder for one run; the destructor removes it.
class RunFolder {
 public:
  RunFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "subworld_link_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr)
      throw Error(ExitCode::failed, fmt::format("{}: no temporary folder; TMPDIR names another place", name));
    path_ = name;
  }
  ~RunFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  RunFolder(const RunFolder&) = delete;
  RunFolder& operator=(const RunFolder&) = delete;
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// The session file of a run: the world on a host, and each user on one.
std::string session_text(const Point& point, const Scene& scene, const OverLink& over) {
  std::string text = fmt::format("name: over_link\nscene: {}\ndds: {}\ndomain: {}\nlink: {}\n",
                                 std::filesystem::absolute(point.scene).string(), over.dds, over.domain, over.link);
  text += fmt::format("flags: {{mode: realtime, duration: {}, scheme: {}", scene.settings.duration_s,
                      scene.settings.scheme);
  if (point.ratio > 0) text += fmt::format(", ratio: {}", point.ratio);
  if (!point.passivity.empty()) text += fmt::format(", passivity: {}", point.passivity);
  if (!point.engine.empty()) text += fmt::format(", engine: {}", point.engine);
  if (!point.haptic_engine.empty()) text += fmt::format(", haptic-engine: {}", point.haptic_engine);
  if (point.deadband > 0.0) text += fmt::format(", deadband: {}", point.deadband);
  text += "}\nhosts:\n  - name: world\n    programs: [world_sim]\n";
  for (int user = 0; user < scene.settings.users; ++user)
    text += fmt::format("  - name: user_{0}\n    programs: [haptic_sim {0}, device_sim {0}]\n", user);
  return text;
}

/// What a haptic process writes of each step.
struct HapticHistory {
  DevicePath device;
  std::vector<Vec3> force, on_operator;  ///< N
};

HapticHistory read_history(const std::string& file) {
  constexpr std::size_t kColumns = 16;  // time, force, operator_force, torque, proxy, device
  std::ifstream in(file);
  HapticHistory history;
  std::string line;
  std::getline(in, line);
  if (!line.starts_with("time_s,force_x_n,")) throw Error(ExitCode::failed, file + ": is not a haptic history");
  while (std::getline(in, line)) {
    std::array<double, kColumns> row{};
    const char* at = line.c_str();
    for (double& value : row) {
      char* end = nullptr;
      value = std::strtod(at, &end);
      at = *end == ',' ? end + 1 : end;
    }
    if (!history.device.time_s.empty() && row[0] <= history.device.time_s.back()) continue;
    history.device.time_s.push_back(row[0]);
    history.force.emplace_back(row[1], row[2], row[3]);
    history.on_operator.emplace_back(row[4], row[5], row[6]);
    history.device.position.emplace_back(row[13], row[14], row[15]);
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

/// On the reference's steps, as far as the history reaches.
FeltHistory on_steps(const HapticHistory& history, std::size_t steps, double h_s) {
  FeltHistory felt;
  for (std::size_t i = 0; i < steps; ++i) {
    const double t_s = static_cast<double>(i) * h_s;
    if (t_s > history.device.time_s.back()) break;
    felt.force.push_back(at_time(history.device.time_s, history.force, t_s));
    felt.on_operator.push_back(at_time(history.device.time_s, history.on_operator, t_s));
  }
  return felt;
}

/// The reference with the paths of its users so much later.
Scene later(const Point& point, const std::vector<double>& path_delay_s) {
  Scene scene = reference_scene_of(point);
  for (std::size_t user = 0; user < path_delay_s.size(); ++user) {
    for (PathSegment& segment : scene.users[user].device.path) {
      segment.from_s = std::max(0.0, segment.from_s + path_delay_s[user]);
      segment.to_s = std::max(segment.from_s, segment.to_s + path_delay_s[user]);
    }
  }
  return scene;
}

/// The launcher's last lines, which name the fault.
std::string end_of_text(const std::string& text) {
  constexpr std::size_t kMost = 1000;
  return text.size() <= kMost ? text : text.substr(text.find('\n', text.size() - kMost) + 1);
}

}  // namespace

double path_delay_s(const DevicePath& path, const std::vector<Vec3>& reference, double h_s, double most_s) {
  const auto difference = [&](double delay_s) {
    double sum = 0.0;
    for (std::size_t i = 0; i < reference.size(); ++i) {
      const double t_s = static_cast<double>(i) * h_s + delay_s;
      sum += (at_time(path.time_s, path.position, t_s) - reference[i]).squaredNorm();
    }
    return sum;
  };
  double best_s = 0.0;
  double step_s = 0.01, range_s = most_s;
  for (constexpr double kFinest_s = 1e-4; step_s > 0.5 * kFinest_s; range_s = step_s, step_s *= 0.1) {
    const double centre_s = best_s;
    double least = std::numeric_limits<double>::infinity();
    const auto n = static_cast<int>(std::lround(range_s / step_s));
    for (int i = -n; i <= n; ++i) {
      const double delay_s = centre_s + i * step_s;
      const double sum = difference(delay_s);
      if (sum >= least) continue;
      least = sum;
      best_s = delay_s;
    }
  }
  return best_s;
}

std::optional<LinkedRun> run_over_link(const Point& point, const OverLink& over, const Outcome& punctual) {
  const Scene scene = scene_of(point);
  const RunFolder folder;
  const std::string session = folder.path() + "/over_link.yaml", out = folder.path() + "/out";
  std::ofstream(session) << session_text(point, scene, over);
  const std::string launcher = std::filesystem::read_symlink("/proc/self/exe").parent_path().string() + "/subworld";
  const Finished ended = run_program({launcher, "up", session, "--namespaces", "--out", out}, nullptr);
  if (stop_signal() != 0) return std::nullopt;
  if (ended.code != 0)
    throw Error(ExitCode::failed, fmt::format("the run over the link {} ended with exit code {}:\n{}", over.link,
                                              ended.code, end_of_text(ended.text)));
  LinkedRun run;
  run.summary = read_json(out + "/summary.json");
  for (std::size_t user = 0; user < punctual.felt.size(); ++user) {
    const HapticHistory history = read_history(fmt::format("{}/haptic_{}.csv", out, user));
    const FeltHistory& expected = punctual.felt[user];
    run.path_delay_s.push_back(path_delay_s(history.device, expected.device, scene.settings.h_s));
    run.felt.push_back(on_steps(history, expected.force.size(), scene.settings.h_s));
  }
  std::optional<Outcome> reference = run_out(later(point, run.path_delay_s));
  if (!reference) return std::nullopt;
  run.reference = std::move(*reference);
  return run;
}

}  // namespace subworld
