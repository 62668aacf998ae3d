#pragma once

#include "io/options/machine_share.hpp"
#include "io/options/options.hpp"
#include "io/records/history.hpp"
#include "io/records/trace.hpp"
#include "io/results/results.hpp"
#include "rt/stages.hpp"
#include "wire/status.hpp"

#include <initializer_list>
#include <span>
#include <string>
#include <utility>

namespace subworld {

/// Measurements of a program's loop for its results: stages, step times, missed deadlines and what the kernel gave to
/// it, with a history and a trace. Each program adds its own.
template <class Stage>
class LoopMeasures {
 public:
  [[nodiscard]] Stages<Stage>& stages() noexcept { return stages_; }
  /// loop_begins() and loop_ends() enclose a loop in real time; call them in its thread.
  void loop_begins(const Scheduling& granted) { machine_.begin(granted); }
  void loop_ends() { machine_.end(); }
  /// At `now` a peer answers what was sent then; 0: nothing was. Only the first answer is a round trip: a paused peer
  /// repeats its last one.
  void answered(std::int64_t sent_ns, TimePoint now) noexcept {
    if (std::exchange(answered_ns_, sent_ns) != sent_ns && sent_ns != 0)
      round_trip_.add(1e-9 * static_cast<double>(to_ns(now) - sent_ns));
  }
  /// Why the history could not be written; empty if there was no error.
  [[nodiscard]] std::string fault() const { return history_.fault(); }

 protected:
  /// The history is FILE.csv in the folder --out, the trace is --trace; neither is written without its option.
  /// `columns` and `stages` are their names. Throws `Error` (failed) if a file cannot be written.
  LoopMeasures(const Options& options, const std::string& file, const std::string& columns, const TraceProgram& program,
               std::span<const char* const> stages, const History::Say& say)
      : space_(options.out.empty() ? "" : options.out + "/" + file + ".json"),
        history_(options.out.empty() ? "" : options.out + "/" + file + ".csv", columns, say),
        trace_(options.trace, program, stages, say),
        names_(stages) {}

  void add(const StepTimes& times) noexcept {
    ++steps_;
    misses_.add(times.miss);
    step_.add(times.step_s);
    lateness_.add(times.lateness_s);
    woken_late_.add(times.woken_late_s);
    newest_ = times;
  }
  /// Ends the step's stages, and traces them with these counters and events.
  void end_step(std::initializer_list<std::pair<Trace::Name, double>> counters,
                std::initializer_list<std::pair<Trace::Name, bool>> events) noexcept {
    const StageStep step = stages_.end();
    for (const auto& [name, value] : counters) trace_.counter(name, step.begin, value);
    for (const auto& [name, occurred] : events) {
      if (occurred) trace_.instant(name, step.begin);
    }
    trace_.step(step);
  }
  /// Data of the loop for the status.
  [[nodiscard]] LoopState state(double time_s, double force_n, double real_time_factor) const noexcept {
    return {time_s, steps_, misses_.all(), misses_.by_os, step_.sum_s(), force_n, real_time_factor};
  }
  /// Call after the last step: sets what all programs measure.
  template <class Result>
  void add_to(Result& result) {
    history_.finish();
    result.step_s = quantiles(step_);
    result.woken_late_s = quantiles(woken_late_);
    result.machine = machine_;
    result.stages = subworld::stages(stages_.times(), names_);
    result.history_rows_dropped = history_.dropped();
    result.trace_events_dropped = trace_.dropped();
  }

  ReservedFile space_;  ///< for the results
  History history_;
  Stages<Stage> stages_;
  std::uint64_t steps_ = 0;
  Misses misses_;
  Histogram lateness_, round_trip_;
  StepTimes newest_;

 private:
  Trace trace_;
  std::span<const char* const> names_;
  Histogram step_, woken_late_;
  std::int64_t answered_ns_ = 0;  ///< when the newest of what was answered was sent
  MachineShare machine_;
};

}  // namespace subworld
