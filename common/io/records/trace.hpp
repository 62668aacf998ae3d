#pragma once

#include "io/records/history.hpp"
#include "rt/stages.hpp"

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace subworld {

/// The program of a trace. The numbers order the programs in a viewer and distinguish them in a merged file.
struct TraceProgram {
  std::string name;  ///< "haptic_sim 0"
  int number = 0;
};

/// A loop's steps, stages, counters and events as Chrome trace events, for Perfetto, chrome://tracing and speedscope.
/// Times are the machine's steady clock, so traces of programs on one machine fit together. Events go through a ring to
/// a thread of their own; a full ring drops and counts them. Times must ascend.
class Trace {
 public:
  /// An empty path: records nothing. `stages` are the names of the loop's stages, by number. Throws `Error` (failed) if
  /// the file cannot be written.
  Trace(const std::string& path, const TraceProgram& program, std::span<const char* const> stages, History::Say say);

  /// Records a step and its stages.
  void step(const StageStep& step) noexcept;
  /// Records a value that holds from `at` on, or an event. `at` is the begin of the step; call before `step`.
  enum class Name : std::uint8_t { force_n, members, lateness_s, real_time_factor, missed_deadline, lost_frames };
  void counter(Name name, TimePoint at, double value) noexcept;
  void instant(Name name, TimePoint at) noexcept;

  [[nodiscard]] std::uint64_t dropped() const noexcept { return rows_.dropped(); }

 private:
  bool on_;
  History rows_;
};

/// The trace of a program of this machine, or of another one whose wall clock is ahead of this one's.
struct TracePart {
  std::string file;
  std::optional<double> ahead_s = {};
};

/// Merges the traces of several programs into one, by the clock of this machine. An unfinished file is used as far as
/// it goes; a missing one is skipped. Throws `Error` (failed) if the trace cannot be written.
void merge_traces(const std::vector<TracePart>& parts, const std::string& path);

}  // namespace subworld
