#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace subworld {

/// The haptic clock against the world's, in real time. At full speed the haptic loop keeps its own pace, slewed by a
/// few ppm; on a slowed clock its steps cover less simulated time:
///   rate = f (1 + kFollow e) b,
/// f the world's real-time factor, e (cycles) by how much the haptic clock is late, b <= 1 a brake where frames stay
/// away. The rate changes a little in each step, so that no step of the clock is felt.
///
/// Between hosts a frame takes longer or shorter than others, and some are lost. There e is the median of the newest
/// frames, and the brake waits longer: else the clock would follow each frame's delay, which is felt.
class Phase {
 public:
  static constexpr double kFollow = 0.2;       ///< of a cycle of lateness, made up for in a cycle
  static constexpr double kMostCatchUp = 0.1;  ///< of the rate
  static constexpr double kMostWait = 0.9;     ///< of the rate, where the haptic clock is ahead
  static constexpr double kRateStep = 0.03;    ///< most that the rate changes in a step, as a part of it
  static constexpr double kFree_cycles = 3.5;  ///< past the newest frame without a brake: a world catches up with 2
  static constexpr double kFreeBetweenHosts_cycles = 25.0;
  static constexpr std::size_t kFramesBetweenHosts = 51;
  static constexpr double kBraking_cycles = 8.0;  ///< from there to a stop
  static constexpr double kCutOff = 0.5;          ///< of the brake
  static constexpr double kSlewLimit_ppm = 200.0;

  /// `cycle_s`: the longest cycle; `lead_cycles`: by how many cycles frames come late because the haptic clock is
  /// ahead.
  Phase(double cycle_s, int lead_cycles, bool between_hosts = false) noexcept
      : cycle_s_(cycle_s),
        lead_cycles_(lead_cycles),
        free_cycles_(between_hosts ? kFreeBetweenHosts_cycles : kFree_cycles),
        caught_up_cycles_(between_hosts ? kCaughtUpBetweenHosts_cycles : kCaughtUp_cycles),
        frames_(between_hosts ? kFramesBetweenHosts : 1) {}

  /// A frame has come. `ahead_s`: by how much the haptic clock is to be ahead of the world's when that shows the
  /// frame's stamp; `head_start_s`: between hosts, the round trip on top of that; `until_s`: wall time until it does,
  /// s; `haptic_s`: the haptic clock now; `wall_s`: wall time now, from any instant on.
  void observe(double stamp_s, double ahead_s, double head_start_s, double until_s, double real_time_factor,
               double haptic_s, double wall_s) noexcept {
    head_start_s_ = head_start_s;
    if (real_time_factor != factor_) count_ = 0;  // the offset of the clocks changes from here on
    const double offset_s = offset(stamp_s + ahead_s - real_time_factor * (until_s + wall_s));
    const double late_s = offset_s + real_time_factor * wall_s + head_start_s - haptic_s;
    late_cycles_ = late_s / cycle_s_;
    newest_stamp_s_ = seen_ ? std::max(newest_stamp_s_, stamp_s) : stamp_s;
    factor_ = real_time_factor;
    // A clock that is slowed, or far away, is followed until the haptic clock is where it should be.
    following_ = factor_ < 1.0 || std::abs(late_cycles_) > (following_ ? caught_up_cycles_ : kFar_cycles);
    estimate_s_ = seen_ && !following_ ? estimate_s_ + kFilter * (late_s - estimate_s_) : late_s;
    seen_ = true;
    // A world that goes on is to begin later: this clock stands until then.
    const bool early = stood_ && factor_ > 0.0 && late_cycles_ < -kFar_cycles;
    waits_s_ = early ? -late_s / factor_ : std::min(waits_s_, 0.0);
  }

  /// For the step of `wall_s` that begins now: simulated seconds per second.
  double step(double haptic_s, double wall_s) noexcept {
    const bool stands = this->stands();
    const bool waited = waits_s_ > 0.0;
    waits_s_ -= wall_s;
    if (waited && waits_s_ <= 0.0) late_cycles_ = estimate_s_ = 0.0;
    const double wanted = stands ? 0.0 : target(haptic_s);
    const double most = kRateStep * std::max(rate_, kSlowest);
    // A world that stands or goes on again does so at once: the force fades out and in.
    rate_ = stands || stood_ ? wanted : rate_ + std::clamp(wanted - rate_, -most, most);
    stood_ = stands;
    return rate_;
  }

  /// Frames have stayed away for so long that the brake is below one half. What moves in the sub-world has velocities
  /// of its own slow clock then, which mean nothing to the world.
  [[nodiscard]] bool cut_off() const noexcept { return brake_ < kCutOff; }
  /// The world is paused, or not begun yet.
  [[nodiscard]] bool stands() const noexcept { return factor_ <= 0.0 || waits_s_ > 0.0; }
  /// The sub-world starts anew: its clock has the wanted rate at once, because the force begins anew too.
  void restart() noexcept { stood_ = true; }

  [[nodiscard]] double rate() const noexcept { return rate_; }
  [[nodiscard]] double real_time_factor() const noexcept { return factor_; }
  /// By which the period is stretched while the clock runs at full speed.
  [[nodiscard]] double slew_ppm() const noexcept {
    return following_ ? 0.0 : std::clamp(-1e6 * estimate_s_, -kSlewLimit_ppm, kSlewLimit_ppm);
  }

 private:
  static constexpr double kFilter = 0.02;  ///< of one frame in the phase estimate
  static constexpr double kSlowest = 0.01;
  static constexpr double kFar_cycles = 1.0;
  static constexpr double kCaughtUp_cycles = 0.05, kCaughtUpBetweenHosts_cycles = 0.5;

  [[nodiscard]] double target(double haptic_s) noexcept {
    const double late = following_ ? std::clamp(kFollow * late_cycles_, -kMostWait, kMostCatchUp) : 0.0;
    const double past = (haptic_s - newest_stamp_s_ - head_start_s_) / cycle_s_ - lead_cycles_ - free_cycles_;
    brake_ = seen_ ? std::clamp(1.0 - past / kBraking_cycles, 0.0, 1.0) : 1.0;
    return factor_ * (1.0 + late) * brake_;
  }

  /// Of the haptic clock to wall time, at full speed: the median of the newest frames. `newest`: by this frame.
  double offset(double newest) noexcept {
    offsets_[count_++ % frames_] = newest;
    std::array<double, kFramesBetweenHosts> sorted = offsets_;
    const auto end = sorted.begin() + static_cast<std::ptrdiff_t>(std::min(count_, frames_));
    const auto middle = sorted.begin() + (end - sorted.begin()) / 2;
    std::nth_element(sorted.begin(), middle, end);
    return *middle;
  }

  double cycle_s_;
  int lead_cycles_;
  double free_cycles_;
  double caught_up_cycles_;
  std::size_t frames_;  ///< of the median
  std::array<double, kFramesBetweenHosts> offsets_{};
  std::size_t count_ = 0;  ///< of offsets, at this real-time factor
  double estimate_s_ = 0.0;
  double head_start_s_ = 0.0;
  double late_cycles_ = 0.0;
  double newest_stamp_s_ = 0.0;
  double factor_ = 1.0;
  double rate_ = 1.0;
  double brake_ = 1.0;
  double waits_s_ = 0.0;  ///< wall time until the clock goes on
  bool following_ = false;
  bool seen_ = false;
  bool stood_ = false;  ///< takes on its rate at once
};

}  // namespace subworld
