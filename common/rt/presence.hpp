#pragma once

namespace subworld {

/// Without a sign of life for so long, s, a peer is gone. The limit is generous: a busy machine, or a program that is
/// suspended for a moment, ends no run.
inline constexpr double kGone_s = 2.0;

/// Whether a peer is present, measured in the time of the calling loop. A process that was suspended itself does not
/// count the time of its suspension.
class Presence {
 public:
  /// Call once a period. `heard`: the peer sent a message since the last call; `alive`: the peer is known to be alive
  /// without one.
  void observe(bool heard, bool alive, double period_s) noexcept {
    quiet_s_ = heard ? 0.0 : quiet_s_ + period_s;
    dead_s_ = heard || alive ? 0.0 : dead_s_ + period_s;
  }
  /// Time since the newest message, s.
  [[nodiscard]] double quiet_s() const noexcept { return quiet_s_; }
  [[nodiscard]] bool gone() const noexcept { return quiet_s_ > kGone_s && dead_s_ > 0.0; }
  /// Time without any sign of life, s.
  [[nodiscard]] double dead_s() const noexcept { return dead_s_; }

 private:
  double quiet_s_ = 0.0;
  double dead_s_ = 0.0;
};

}  // namespace subworld
