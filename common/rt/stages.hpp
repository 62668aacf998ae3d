#pragma once

#include "rt/cyclic.hpp"
#include "rt/histogram.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

namespace subworld {

inline constexpr std::size_t kWaitingStage = 0;  ///< of every loop

/// Interval of a loop's step that belongs to one stage.
struct StageStretch {
  std::size_t stage = 0;
  TimePoint begin;
  TimePoint end;
};

/// A step of a loop, and its stretches in order of time.
struct StageStep {
  TimePoint begin;
  TimePoint end;
  std::span<const StageStretch> stretches;
};

/// Measures the time of each stage of a loop's step. `Enum` lists the loop's stages: `wake` first, which is waiting,
/// and `count` last. The time between two marks is a stretch of the stage that the second mark names. The stretches of
/// one stage in a step are added up to one entry in its histogram; a stage that does not occur adds none. A stretch
/// costs about two readings of the clock: ten of them less than 0.1 % of a millisecond (bench_stage_cost).
template <class Enum>
class Stages {
 public:
  using Stage = Enum;
  static constexpr std::size_t kCount = static_cast<std::size_t>(Stage::count);
  static_assert(static_cast<std::size_t>(Stage::wake) == kWaitingStage);

  /// The first step begins now.
  void begin() noexcept { step_.begin = last_ = Clock::now(); }
  /// The step begins at `release` with waking up, until `woke`, but not before the end of the previous step.
  void begin(TimePoint release, TimePoint woke) noexcept {
    step_.begin = last_ = std::max(last_, std::min(release, woke));
    add(Stage::wake, woke);
  }
  /// Assigns the time since the last mark to `stage`. Returns the time.
  TimePoint mark(Stage stage) noexcept {
    const TimePoint now = Clock::now();
    add(stage, now);
    return now;
  }
  /// Ends the step and begins the next one. The result is valid until the next mark.
  StageStep end() noexcept {
    for (std::size_t i = 0; i < kCount; ++i) {
      if (spent_[i] == Clock::duration::zero()) continue;
      times_[i].add(to_seconds(spent_[i]));
      spent_[i] = Clock::duration::zero();
    }
    const StageStep done{step_.begin, last_, std::span(stretches_.data(), count_)};
    step_.begin = last_;
    count_ = 0;
    return done;
  }

  /// Time of the last mark.
  [[nodiscard]] TimePoint now() const noexcept { return last_; }
  /// One histogram for each stage.
  [[nodiscard]] std::span<const Histogram> times() const noexcept { return times_; }

 private:
  void add(Stage stage, TimePoint now) noexcept {
    const auto i = static_cast<std::size_t>(stage);
    spent_[i] += now - last_;
    if (count_ > 0 && stretches_[count_ - 1].stage == i) {
      stretches_[count_ - 1].end = now;
    } else if (count_ < stretches_.size()) {
      stretches_[count_++] = {i, last_, now};
    }
    last_ = now;
  }

  static constexpr std::size_t kMostStretches = 64;  ///< of a step; further stretches are counted but not listed
  std::array<Histogram, kCount> times_;
  std::array<Clock::duration, kCount> spent_{};
  std::array<StageStretch, kMostStretches> stretches_;
  std::size_t count_ = 0;
  StageStep step_;
  TimePoint last_{};
};

}  // namespace subworld
