#pragma once

namespace subworld {

/// Without a sign of life for so long a peer is taken for dead in real time. Generous: a machine that is busy, or a
/// person who halts a program for a moment, ends no run.
inline constexpr double kGone_s = 2.0;

/// Whether a peer is there, in the time of the loop that asks: a process that was itself halted takes nobody for dead.
class Presence {
 public:
  /// Once a period. `heard`: something came from it since the last call; `alive`: it may be silent and yet be there.
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
