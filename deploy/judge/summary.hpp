#pragma once

#include "io/results/json.hpp"
#include "io/results/program_results.hpp"
#include "judge/gates.hpp"
#include "model/scene/scene.hpp"
#include "record/recording.hpp"
#include "rt/calibration.hpp"
#include "rt/kernel_share.hpp"
#include "run/placement.hpp"
#include "run/supervise.hpp"

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace subworld {

/// Wake-ups of bare loops before a run. One is late that takes longer than the time that a haptic step leaves of its
/// period.
struct BareLoops {
  double period_s = 0.0;
  int loops = 0;
  std::uint64_t wake_ups = 0, late = 0;
  double late_means_s = 0.0;
  Quantiles woken_late_s;
  bool fifo = false;
};

/// The wall clock of a host of a session.
struct HostClock {
  std::string host;
  std::optional<double> offset_s = {};  ///< its clock minus that of the launcher
  std::optional<double> uncertainty_s = {};
};

/// What ran, where, and what the programs measured: the source of gates, verdict and summary.
struct RunResults : WorldPart {
  Scene scene;
  std::string command_line;
  std::string date;  ///< of the start, ISO 8601 with the zone
  std::string dds;   ///< a vendor or mixed
  Placement placement;
  double wall_s = 0.0;
  bool between_hosts = false;  ///< programs ran on several hosts
  int cores = machine_cores();
  std::optional<CoreLoad> load;          ///< empty: not measured, as of the hosts of a session
  std::optional<CpuQuota> quota;         ///< of the run's control group
  std::optional<BareLoops> calibration;  ///< in real time
  std::vector<HapticResult> haptic;      ///< by user, as `device`; empty: the programs have written no results
  std::vector<DeviceResult> device;
  std::string session;              ///< its file; empty: none
  std::optional<std::string> link;  ///< of a session with namespaces: between any two, in the words of `subworld link`
  std::vector<HostClock> hosts;     ///< of a session
  std::vector<Restarted> restarts;  ///< by the launcher
  std::optional<RecordingResult> recording;
  std::vector<Gate> gates;
  std::string verdict;
  bool partial = false;  ///< the run has no orderly end
  Json salvaged;         ///< instead of `world`, `haptic` and `device`, where programs have written no results
  std::optional<std::string> display;  ///< how the display died

  [[nodiscard]] bool realtime() const noexcept { return scene.settings.mode == Mode::realtime; }
  /// A network or the settings delayed messages by a time that the programs did not know beforehand.
  [[nodiscard]] bool has_unknown_delay() const noexcept {
    return realtime() && (between_hosts || scene.settings.has_unknown_delay());
  }
};

/// File in which a program writes its part of the results. `user`: negative for the world.
[[nodiscard]] std::string part_file(const std::string& folder, std::string_view program, int user);
/// "haptic_sim 0" of "DIR/haptic_0.json".
[[nodiscard]] std::string program_of_part(const std::string& part_file);
/// Reads what the programs wrote into the folder. Throws `Error` (failed) where a part is missing.
void read_parts(RunResults& run, const std::string& folder, const std::optional<Calibration>& calibration);

/// The contents of summary.json.
void to_json(Json& json, const RunResults& run);

/// Prints the run in a few lines.
void print_summary(const RunResults& run);

}  // namespace subworld
