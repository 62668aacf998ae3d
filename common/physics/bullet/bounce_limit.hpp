#pragma once

#include "contact_rows.hpp"
#include "movers.hpp"

#include <cstdint>
#include <span>
#include <vector>

namespace subworld::bullet {

/// Keeps bounces from winning energy. Newton's restitution lets each contact part at a share of the speed at which it
/// met. Where friction acts in the same blow, or several contacts bounce at once, bodies may then leave with more
/// energy than they came with (Kane and Levinson 1985; Stronge 1990 asks for a restitution that energy bounds). So the
/// bodies that hang together by contacts share a part of their restitution: 1, or what leaves them the energy that they
/// had. It is searched: the first guess takes the energy for a parabola in it, the others are by the secant method.
class BounceLimit {
 public:
  static constexpr int kMostTries = 5;

  /// Forgets all. `movers` and what follows are of one step.
  void begin(std::span<const Mover> movers);
  /// Two movers touch; `bounces`: with restitution.
  void join(std::size_t a, std::size_t b, bool bounces);
  [[nodiscard]] bool any() const noexcept { return any_; }

  /// Of the velocities that the movers had, with what forces add, and of those that impulses leave them with: whether
  /// some win energy, and part() is lower than before. `last`: there is no further try, they do not bounce.
  bool lower(std::span<const Motion> before, std::span<const Motion> after, bool last);
  /// Of its restitution that the contacts of two movers keep, 0 .. 1.
  [[nodiscard]] btScalar part(std::size_t a, std::size_t b) noexcept;

 private:
  /// Movers that hang together.
  struct Island {
    btScalar had_j = 0, gain_j = 0;
    btScalar part = 1;
    btScalar last_part = 0, last_gain_j = 0;  ///< of the try before
    bool bounces = false, tried = false;
  };
  std::size_t root(std::size_t i) noexcept;

  std::span<const Mover> movers_;
  std::vector<std::uint32_t> parents_;  ///< by mover
  std::vector<Island> islands_;         ///< by root
  bool any_ = false;
};

/// J.
[[nodiscard]] btScalar kinetic_energy(const Mover& mover, const Motion& motion);

}  // namespace subworld::bullet
