#pragma once

namespace subworld {

/// A peer counts as gone in real time after this time without a sign of life, s. The limit is generous: a busy machine,
/// or a program that is suspended for a moment, ends no run.
inline constexpr double kGone_s = 2.0;

/// Whether a peer is present, measured in the time of the calling loop. A process that was suspended itself does not
/// count the time of its suspension.
class Presence {
 public:
  /// Call once a period. `heard`: the peer sent a message since the last call; `alive`: the peer is known to be alive
  /// without one.
  void observe(bool heard, bool alive, double period_s) noexcept {
    quiet_s_ = heard ? 0.0 : quiet_s_ + period_s;
    gone_ = quiet_s_ > kGone_s && !alive;
  }
  [[nodiscard]] bool gone() const noexcept { return gone_; }

 private:
  double quiet_s_ = 0.0;
  bool gone_ = false;
};

}  // namespace subworld
