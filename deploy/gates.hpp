#pragma once

#include "io/results.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace subworld {

/// Who is to blame for a missed gate. `unstable`: energy or swings that nobody has put in; `stranger`: a program that
/// does not belong to the run.
enum class Culprit : std::uint8_t { run, os, scene, unstable, foreign_writer };

/// One measured quantity against its bar.
struct Gate {
  std::string name;
  double value = 0.0;
  double bar = 0.0;
  bool at_most = true;
  const char* unit = "";
  double scale = 1.0;  ///< from SI to the unit
  Culprit culprit = Culprit::run;
  std::string why = {};  ///< for a reader of a missed gate: the reason and the cure

  [[nodiscard]] bool ok() const noexcept { return at_most ? value <= bar : value >= bar; }
  /// What a scene asks for is warned of; the verdict stays.
  [[nodiscard]] bool spoils_verdict() const noexcept { return !ok() && culprit != Culprit::scene; }
  [[nodiscard]] std::string line() const;
};

/// What a run is held against: in real time deadlines, lateness, lost frames and the world's clock; in lock-step loss
/// alone. In both the device's limit.
[[nodiscard]] std::vector<Gate> gates(const Json& summary);
[[nodiscard]] Json to_json(const Gate& gate);

/// "ok" with what the machine did, or which gates were missed, by whom, and what to do about it.
[[nodiscard]] std::string verdict_of(const std::vector<Gate>& gates, const Json& summary);

/// Of a time in s.
[[nodiscard]] double milliseconds(const Json& seconds);
/// What kept the loops from their cores, in words.
[[nodiscard]] std::string load_text(const Json& summary);
/// How late the machine wakes a bare loop.
[[nodiscard]] std::string calibration_text(const Json& summary);

}  // namespace subworld
