#pragma once

#include "model/types.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace subworld {

/// Detects a force that oscillates faster than an operator can move: a limit cycle of coupling and device, or a buzz.
/// In each block of time it takes the root mean square of what a first-order high-pass leaves of the force, where the
/// sign of its strongest axis changes often enough. What counts is what lasts for several blocks: an impact rings down.
class OscillationWatch {
 public:
  static constexpr double kLeast_hz = 15.0;  ///< above voluntary motion and tremor, 8 to 12 Hz
  static constexpr double kHighPass_hz = 5.0;
  static constexpr double kBlock_s = 0.2;
  static constexpr std::size_t kLasting = 5;  ///< blocks

  void step(const Vec3& force_n, double dt) noexcept {
    slow_n_ += std::min(1.0, 2.0 * M_PI * kHighPass_hz * dt) * (force_n - slow_n_);
    const Vec3 deviation = force_n - slow_n_;
    for (int i = 0; i < 3; ++i) {
      squares_[i] += deviation[i] * deviation[i];
      crossings_[i] += deviation[i] * before_n_[i] < 0.0;
    }
    before_n_ = deviation;
    ++steps_;
    passed_s_ += dt;
    if (passed_s_ >= kBlock_s) close();
  }

  /// N: the least of kLasting blocks in a row, where it was worst; 0 where the force never oscillated so fast for so
  /// long.
  [[nodiscard]] double worst_n() const noexcept { return worst_n_; }

 private:
  void close() noexcept {
    const auto axis = static_cast<std::size_t>(std::ranges::max_element(squares_) - squares_.begin());
    const bool oscillates = crossings_[axis] >= 2.0 * kLeast_hz * passed_s_;
    blocks_n_[block_++ % kLasting] = oscillates ? std::sqrt((squares_[0] + squares_[1] + squares_[2]) / steps_) : 0.0;
    worst_n_ = std::max(worst_n_, *std::ranges::min_element(blocks_n_));
    squares_ = {};
    crossings_ = {};
    steps_ = 0;
    passed_s_ = 0.0;
  }

  Vec3 slow_n_ = Vec3::Zero(), before_n_ = Vec3::Zero();
  std::array<double, 3> squares_{};
  std::array<int, 3> crossings_{};
  std::array<double, kLasting> blocks_n_{};
  std::size_t block_ = 0;
  int steps_ = 0;
  double passed_s_ = 0.0;
  double worst_n_ = 0.0;
};

}  // namespace subworld
