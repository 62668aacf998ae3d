#pragma once

#include "io/results.hpp"
#include "model/scene.hpp"
#include "placement.hpp"
#include "rt/calibration.hpp"

#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// What the launcher knows of a run besides what the programs wrote.
struct RunRecord {
  std::string command_line;
  std::string date;  ///< of the start, ISO 8601 with the zone
  std::string dds;   ///< a vendor or mixed
  std::optional<Calibration> calibration;
  Placement placement;
  double wall_s = 0.0;
  double own_cpu_s = 0.0;    ///< of all programs of the run
  double other_cpu_s = 0.0;  ///< of everything else on the machine meanwhile
  double stolen_s = 0.0;     ///< by the hypervisor meanwhile
};

/// Who is to blame for a missed gate. `unstable`: energy or swings that nobody has put in; `stranger`: a program that does
/// not belong to the run.
enum class Culprit : std::uint8_t { us, machine, scene, unstable, stranger };

/// One measured quantity against its bar.
struct Gate {
  std::string name;
  double value = 0.0;
  double bar = 0.0;
  bool at_most = true;
  const char* unit = "";
  double scale = 1.0;  ///< from SI to the unit
  Culprit culprit = Culprit::us;
  std::string why = {};  ///< for a reader of a missed gate: the reason and the cure

  [[nodiscard]] bool ok() const noexcept { return at_most ? value <= bar : value >= bar; }
  /// What a scene asks for is warned of; the verdict stays.
  [[nodiscard]] bool spoils_verdict() const noexcept { return !ok() && culprit != Culprit::scene; }
  [[nodiscard]] std::string line() const;
};

/// What ran, with which settings and where: all that does not come from the programs.
[[nodiscard]] Json describe_run(const Scene& scene, const RunRecord& record);
/// Adds the parts that the programs wrote into the folder. Throws `Error` (failed) where one is missing.
void add_parts(Json& summary, const Scene& scene, const RunRecord& record, const std::string& folder);

/// What a run is held against: in real time deadlines, lateness, lost frames and the world's clock; in lock-step loss
/// alone. In both the device's limit.
[[nodiscard]] std::vector<Gate> gates(const Json& summary);
[[nodiscard]] Json to_json(const Gate& gate);

/// "ok" with what the machine did, or which gates were missed, by whom, and what to do about it.
[[nodiscard]] std::string verdict_of(const std::vector<Gate>& gates, const Json& summary);

/// The run in a few lines for a reader.
void print_summary(const Json& summary);

/// One line on the machine's own lateness.
[[nodiscard]] std::string to_text(const Calibration& calibration);

}  // namespace subworld
