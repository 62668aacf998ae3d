#pragma once

#include "io/results/results.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace subworld {

struct RunResults;

/// End of the name of a gate of deadlines that the OS missed.
inline constexpr const char* kMissedByTheOs = "missed by the OS";

/// What caused a missed gate. `unstable`: energy or oscillation that no operator has put in; `foreign_writer`: a
/// program that does not belong to the run; `scene`: the scene asks for it; `network`: the one between the hosts.
enum class Culprit : std::uint8_t { run, os, scene, unstable, foreign_writer, network };

/// Of a gate's value and bound.
struct Unit {
  const char* text;  ///< as printed
  double scale;      ///< from SI
  const char* si;    ///< in the summary
};

/// Who misses a gate, why, and the cure.
struct Cause {
  Culprit culprit = Culprit::run;
  std::string why;
};

/// One measured quantity against its bound, both in SI units.
struct Gate {
  std::string name;
  Unit unit;
  double value = 0.0;
  double bound = 0.0;
  Cause cause;  ///< where it is missed
  bool at_most = true;

  [[nodiscard]] bool ok() const noexcept { return at_most ? value <= bound : value >= bound; }
  /// A gate that the scene, the OS or the network missed is a warning or a remark.
  [[nodiscard]] bool spoils_verdict() const noexcept {
    return !ok() && cause.culprit != Culprit::scene && !is_remark();
  }
  [[nodiscard]] bool is_remark() const noexcept {
    return cause.culprit == Culprit::os || cause.culprit == Culprit::network;
  }
  /// For --strict, which counts remarks too.
  [[nodiscard]] bool counts_strictly() const noexcept { return !ok() && cause.culprit != Culprit::scene; }
  /// "user 0: lateness p99 0.31 ms"
  [[nodiscard]] std::string figure() const;
  [[nodiscard]] std::string line() const;
};
void to_json(Json& json, const Gate& gate);

/// The gates of a run: in both modes energy, oscillation, lost frames and the device's limit; in real time also
/// deadlines, lateness and the world's real-time factor. Causes come before their effects.
[[nodiscard]] std::vector<Gate> gates(const RunResults& run);

/// "ok" with remarks on the OS and the scene, or the first missed gate with its cause and cure.
[[nodiscard]] std::string verdict_of(const std::vector<Gate>& gates, const RunResults& run);
/// The names of the gates for which --strict ends a run with exit code 4.
[[nodiscard]] std::vector<std::string> missed_strictly(const std::vector<Gate>& gates);

/// Which programs used the cores; empty where it was not measured.
[[nodiscard]] std::string load_text(const RunResults& run);
/// How often the machine wakes a bare loop late; empty where it was not measured.
[[nodiscard]] std::string calibration_text(const RunResults& run);
/// "10,034"
[[nodiscard]] std::string grouped(std::uint64_t count);

}  // namespace subworld
