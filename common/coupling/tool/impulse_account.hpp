#pragma once

#include "coupling/tool/virtual_coupling.hpp"
#include "model/messages/exchange.hpp"

namespace subworld {

/// Passes a user's impulse on to the world so that none is lost and none is counted twice, whenever reports come.
///
/// | symbol | unit | is |
/// |---|---|---|
/// | J(t) | N s | impulse since the start: linear between two reports; beyond the newest, with the last slope |
/// | J_w | N s | impulse that the world has applied, up to t_w |
///
/// In the cycle that ends at t, the wrench on the world's proxy is
///   F = (J(t) - J_w) / (t - t_w),  then  J_w = J(t).                                              (18)
/// With reports in time this is the mean wrench of the cycle. A late report corrects in the next cycle what has been
/// guessed without it; a correction beyond the device's limits is spread over several cycles. The guess ends after
/// kLongestGuess_s: the user may have gone.
class ImpulseAccount {
 public:
  /// The constant wrench of the cycle that ends at `until_s`. `now` is the newest report for it, `before` the one
  /// before that.
  [[nodiscard]] Wrench pass(const HapticReport& before, const HapticReport& now, const ForceLimits& limits,
                            double until_s) noexcept;

  /// Adds what acts in the user's place in the cycle that ends at `until_s`.
  void count(const Wrench& instead, double until_s) noexcept;

  /// The account goes on from `from_s`, where J_w is set to J: meanwhile the user was absent.
  void resume(const HapticReport& before, const HapticReport& now, double from_s) noexcept;

  [[nodiscard]] const Wrench& applied() const noexcept { return applied_; }  ///< J_w

 private:
  Wrench applied_;
  double until_s_ = 0.0;  ///< t_w
};

}  // namespace subworld
