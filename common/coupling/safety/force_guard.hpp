#pragma once

#include "coupling/tool/virtual_coupling.hpp"

namespace subworld {

/// Limits of what an operator may get from a device.
struct OperatorLimits {
  ForceLimits wrench;
  double force_rate_n_s = 0.0;     ///< by which the force changes
  double torque_rate_n_m_s = 0.0;  ///< by which the torque changes
  double power_w = 0.0;            ///< of the force along the operator's motion
};

[[nodiscard]] OperatorLimits operator_limits_of(const DeviceSpec& device) noexcept;

/// The last stage before an operator, on each side of the wire and without trust in the other: whatever goes in, what
/// comes out is finite, within the limits of force, of its rate and of its power, and rises from zero. Once a source is
/// not trusted (late or not finite), the last good wrench fades out; once it is trusted again the wrench ramps in anew.
/// After soften() it follows what is wanted gently, until it has caught up.
///
/// The fade is linear within kFadeOut_s. The guard of a device (Loss::ends_force) fades by 1 - (t / kLost_s)^3 instead:
/// its source may have died, and one command that is late by a millisecond is not felt.
class ForceGuard {
 public:
  static constexpr double kFadeOut_s = 0.02;
  static constexpr double kLost_s = 0.005;
  enum class Loss : bool { fades_force, ends_force };

  ForceGuard(const OperatorLimits& limits, double ramp_s, Loss loss = Loss::fades_force) noexcept
      : limits_(limits), ramp_s_(ramp_s), loss_(loss) {}

  /// Call once per step of `dt` seconds, with the wrench on the operator and the device's velocity, m/s.
  [[nodiscard]] Wrench pass(const Wrench& wanted, const Vec3& velocity, bool trusted, double dt) noexcept;

  /// For a moment the wrench changes by little from step to step: something behind it has been exchanged.
  void soften() noexcept { soft_s_ = kSoft_s; }

  /// The wrench fades out, and ramps in anew.
  void declutch() noexcept { declutching_ = true; }

  /// Nothing was sent for so long that the force has faded: the next one begins at zero.
  void restart() noexcept {
    gain_ = 0.0;
    sent_ = {};
  }

 private:
  /// `last` after one step towards `wanted`.
  [[nodiscard]] Wrench follow(const Wrench& wanted, double dt) noexcept;

  static constexpr double kSoft_s = 0.1;  ///< at least so long
  OperatorLimits limits_;
  double ramp_s_;
  Loss loss_;
  double soft_s_ = 0.0;  ///< > 0: soft
  double gain_ = 0.0;
  double lost_s_ = 0.0;  ///< since the source is not trusted
  bool declutching_ = false;
  Wrench last_;  ///< trusted, before the gain
  Wrench sent_;
};

}  // namespace subworld
