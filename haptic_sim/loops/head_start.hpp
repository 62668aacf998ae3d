#pragma once

#include "model/scene/scene.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace subworld {

/// By how much the haptic clock is ahead of the frames that come, in real time: by the round trip to the world, so that
/// the world has each report when it simulates that cycle. Then a delay makes the frames older, which their stamps
/// correct; a report that is late leaves the world to guess what the user does.
///
/// It starts with the round trip of the handshake. Each frame says which report is the newest that the world has. Of a
/// window of frames, the head start grows where more than a fifth of the reports were late, and shrinks where nearly
/// all were two cycles early. After a change the window begins when the change has reached the world and come back.
class HeadStart {
 public:
  static constexpr double kMost_s = kLongestRoundTrip_s;
  static constexpr double kMargin_cycles = 0.5;

  /// `round_trip_s`: of the handshake.
  HeadStart(double round_trip_s, double cycle_s) noexcept
      : head_start_s_(std::clamp(round_trip_s + kMargin_cycles * cycle_s, 0.0, kMost_s)) {}

  /// A frame of `stamp` has come; the newest report that the world had then is of `newest_stamp`.
  void observe(std::uint64_t stamp, std::uint64_t newest_stamp, double cycle_s) noexcept {
    if (pause_ > 0) {
      --pause_;
      return;
    }
    late_[count_++] = std::clamp(static_cast<double>(stamp) - static_cast<double>(newest_stamp), -kFar, kFar);
    if (count_ < late_.size()) return;
    count_ = 0;
    std::sort(late_.begin(), late_.end());
    const double often = late_[late_.size() * 4 / 5], nearly_all = late_[late_.size() * 19 / 20];
    if (often >= 1.0) {
      move((often - kMargin_cycles) * cycle_s, cycle_s);
    } else if (nearly_all <= -2.0) {
      move((nearly_all + 1.0) * cycle_s, cycle_s);
    }
  }

  /// A frame has come while the world uses no reports of this user: those that follow are late until the clock is
  /// right.
  void wait() noexcept {
    count_ = 0;
    pause_ = kJoins;
  }

  [[nodiscard]] double head_start_s() const noexcept { return head_start_s_; }

 private:
  static constexpr double kFar = 1e6;
  static constexpr int kJoins = 40;         ///< frames in which a clock that has started anew catches up
  static constexpr double kFollows = 10.0;  ///< wall time over the change of the clock (Phase::kMostCatchUp)

  void move(double by_s, double cycle_s) noexcept {
    const double to_s = std::clamp(head_start_s_ + by_s, 0.0, kMost_s);
    const double until_s = kFollows * std::abs(to_s - head_start_s_) + 2.0 * std::max(to_s, head_start_s_);
    pause_ = 4 + static_cast<int>(until_s / cycle_s);
    head_start_s_ = to_s;
  }

  double head_start_s_;
  std::array<double, 40> late_{};
  std::size_t count_ = 0;
  int pause_ = 0;  ///< frames
};

}  // namespace subworld
