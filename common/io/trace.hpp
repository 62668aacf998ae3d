#pragma once

#include "io/history.hpp"
#include "rt/stages.hpp"

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace subworld {

/// Whose events a trace holds. The numbers order the programs in a viewer and tell them apart in a merged file.
struct TraceProgram {
  std::string name;  ///< "haptic_sim 0"
  int number = 0;
};

/// A loop's steps, stages, counters and events as Chrome trace events, a file that Perfetto, chrome://tracing and
/// speedscope open: times are the machine's steady clock, so parts of programs on one machine fit together. Events go
/// through a ring to a thread of their own; a full ring drops and counts them. Times ascend.
class Trace {
 public:
  /// An empty path: nothing is traced. `stages` are the names of the loop's stages, by number. Throws `Error` (failed)
  /// where the file cannot be written.
  Trace(const std::string& path, const TraceProgram& program, std::span<const char* const> stages, History::Say say);

  /// A step with what it consisted of.
  void step(const StageStep& step) noexcept;
  /// A number that holds from `at` on, and an event: the step's begin, before `step`.
  enum class Name : std::uint8_t { force_n, members, lateness_s, real_time_factor, missed_deadline, lost_frames };
  void counter(Name name, TimePoint at, double value) noexcept;
  void instant(Name name, TimePoint at) noexcept;

  [[nodiscard]] std::uint64_t dropped() const noexcept { return rows_.dropped(); }

 private:
  bool on_;
  History rows_;
};

/// One trace of several programs' parts. A part that its program could not finish counts as far as it goes; one that is
/// missing is left out. Throws `Error` (failed) where the trace cannot be written.
void merge_traces(const std::vector<std::string>& parts, const std::string& path);

}  // namespace subworld
