#pragma once

#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"

#include <cstdint>
#include <optional>

namespace subworld {

/// Perceptual deadband of the link between a device and its sub-world (Hinterseer, Hirche, Chaudhuri, Steinbach, Buss
/// 2008; Chaudhari, Steinbach 2011): a sample that an operator cannot tell from what its receiver extrapolates is not
/// sent.
///
/// | symbol | meaning | unit |
/// |---|---|---|
/// | p | Weber fraction, `settings.deadband` (at most kMostDeadband) | 1 |
/// | x, v, F | position, velocity and force of the new sample | m, m/s, N |
/// | x', v', F' | what the receiver extrapolates: x_s + v_s t, v_s, F_s of the sample sent last | m, m/s, N |
/// | K, B | stiffness and damping of the virtual coupling | N/m, N s/m |
/// | F_d | the force that the operator feels | N |
/// | e | by how much the receiver is wrong, as a force | N |
///
/// e = K |x - x'| + B |v - v'|  for a motion   (1)
/// e = |F - F'|                 for a force    (2)
/// A sample is sent where e > p max(|F_d|, kLeastForce_n), or kLongestAbsence_s after the one before. Torques likewise,
/// with the rotational K and B.
inline constexpr double kLeastForce_n = 0.5;      ///< a weaker force counts as this: |F_d| = 0 would send everything
inline constexpr double kLeastTorque_n_m = 0.01;  ///< likewise

/// What a receiver makes of a sample after `passed_s`.
[[nodiscard]] DeviceState extrapolated(const DeviceState& sent, double passed_s) noexcept;
[[nodiscard]] DeviceCommand extrapolated(const DeviceCommand& sent, double passed_s) noexcept;

/// The deadband of one direction. `M` is DeviceState or DeviceCommand.
template <class M>
class Deadband {
 public:
  /// Off, and everything is sent, where `fraction` is 0.
  Deadband(double fraction, const UserSpec& user) noexcept : fraction_(fraction), user_(&user) {}

  /// Whether to send a sample, `passed_s` after the one before. `felt`: what the operator feels.
  [[nodiscard]] bool sends(const M& sample, const Wrench& felt, double passed_s) noexcept;
  /// For lock-step, where each step has its message: the sample as its receiver has it.
  [[nodiscard]] M pass(const M& sample, const Wrench& felt, double passed_s) noexcept;

  /// Share of the samples that were sent.
  [[nodiscard]] double sent_ratio() const noexcept {
    return samples_ > 0 ? static_cast<double>(sent_count_) / static_cast<double>(samples_) : 1.0;
  }

 private:
  double fraction_;
  const UserSpec* user_;
  std::optional<M> sent_;
  double passed_s_ = 0.0;  ///< since the sample sent last
  std::uint64_t samples_ = 0, sent_count_ = 0;
};

}  // namespace subworld
