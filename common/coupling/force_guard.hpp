#pragma once

#include "coupling/virtual_coupling.hpp"

namespace subworld {

/// The last thing before a hand: whatever goes in, what comes out is finite, bounded by the device's limits, and rises
/// from zero. While the source is not trusted (stale or not finite) the last good wrench fades out; once it is trusted
/// again the wrench ramps in anew. After soften() it follows what is wanted gently, until it has caught up.
class ForceGuard {
 public:
  ForceGuard(const ForceLimits& limits, double ramp_s) noexcept : limits_(limits), ramp_s_(ramp_s) {}

  /// Call once per haptic step of `dt` seconds.
  [[nodiscard]] Wrench pass(const Wrench& wanted, bool trusted, double dt) noexcept;

  /// For a moment the wrench changes by little from step to step: something behind it has been exchanged.
  void soften() noexcept { soft_s_ = kSoft_s; }

  /// The wrench fades out, and ramps in anew.
  void let_go() noexcept { letting_go_ = true; }

  [[nodiscard]] double gain() const noexcept { return gain_; }

 private:
  /// `last` after one step towards `wanted`.
  [[nodiscard]] Wrench follow(const Wrench& wanted, double dt) noexcept;

  static constexpr double kSoft_s = 0.1;  ///< at least so long
  ForceLimits limits_;
  double ramp_s_;
  double soft_s_ = 0.0;  ///< > 0: soft
  double gain_ = 0.0;
  bool letting_go_ = false;
  Wrench last_;
};

}  // namespace subworld
