#pragma once

#include "coupling/messages/timetable.hpp"
#include "model/scene/scene.hpp"
#include "model/settings/journey.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace subworld {

/// How many haptic steps of `h_s` the message of this number takes.
[[nodiscard]] inline std::uint64_t journey_steps(const Journey& journey, Direction direction, std::uint64_t number,
                                                 double h_s) noexcept {
  return static_cast<std::uint64_t>(std::ceil(journey.delay_s(direction, number) / h_s - 1e-9));
}

/// One direction of the link between a device and its sub-world, in lock-step: one message is sent in each haptic step,
/// and the newest that has arrived counts. The first one has arrived when the loop begins.
template <class M>
class DelayLine {
 public:
  /// `first`: the step of the first message.
  DelayLine(const Settings& settings, Direction direction, std::uint32_t user, std::uint64_t first = 0)
      : journey_(settings.delay, user),
        h_s_(settings.h_s),
        direction_(direction),
        first_(first),
        newest_(first),
        sent_(static_cast<std::size_t>(journey_.longest_s(direction) / settings.h_s) + 2) {}

  /// Sends the message of this step, which counts up from 0, and returns the one that counts now.
  const M& pass(const M& message, std::uint64_t step) noexcept {
    sent_[step % sent_.size()] = message;
    const std::uint64_t oldest = step + 1 > sent_.size() ? step + 1 - sent_.size() : 0;
    for (std::uint64_t number = step + 1; number-- > std::max(oldest, newest_);) {
      if (number + journey_steps(journey_, direction_, number, h_s_) > step || journey_.is_lost(direction_, number))
        continue;
      newest_ = number;
      arrived_ = sent_[number % sent_.size()];
      return arrived_;
    }
    if (step == first_) arrived_ = message;
    return arrived_;
  }

 private:
  Journey journey_;
  double h_s_;
  Direction direction_;
  std::uint64_t first_;
  std::uint64_t newest_;
  std::vector<M> sent_;  ///< by step
  M arrived_;
};

/// When messages arrive in lock-step under an artificial delay: a pure function of the settings, so that both sides
/// know it and a run repeats bit by bit. Times are in haptic steps; messages of one direction arrive in order.
class Delay {
 public:
  /// `lead_cycles`: how many cycles the sub-world runs ahead of the world.
  Delay(const Settings& settings, int lead_cycles, std::uint32_t user) noexcept;

  /// The haptic step before which the sub-world has the frame of this stamp. A world that trails the sub-world by a
  /// cycle first waits for that cycle's report, then needs a cycle of its own.
  [[nodiscard]] std::uint64_t frame_due(std::uint64_t stamp, const Timetable& timetable) const noexcept;
  /// Whether a world at the stamp `world` has the report of this stamp.
  [[nodiscard]] bool report_due(std::uint64_t stamp, std::uint64_t world, const Timetable& timetable) const noexcept;
  /// Most cycles between a stamp and the use of its frame.
  [[nodiscard]] std::uint64_t longest_cycles() const noexcept;

 private:
  [[nodiscard]] std::uint64_t steps(Direction direction, std::uint64_t stamp) const noexcept;

  Journey journey_;
  DelaySettings settings_;
  double h_s_;
  double shortest_cycle_s_;
  std::uint64_t lead_;
};

}  // namespace subworld
