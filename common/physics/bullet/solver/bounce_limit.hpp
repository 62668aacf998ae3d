#pragma once

#include "model/disjoint_sets.hpp"
#include "physics/bullet/movers.hpp"
#include "physics/bullet/solver/contact_rows.hpp"

#include <cstdint>
#include <span>
#include <vector>

namespace subworld::bullet {

/// Limits restitution so that bounces do not gain energy. Newton's restitution gives each contact a share of its
/// approach speed. With friction in the same impact, or with several simultaneous bounces, bodies may then leave with
/// more energy than before (Kane and Levinson 1985; Stronge 1990 proposes a restitution that energy bounds). Therefore
/// all bodies connected by contacts multiply their restitution by a common factor: 1, or the factor that leaves them
/// their previous energy. The factor is searched: the first guess treats the energy as a parabola in it, further ones
/// use the secant method.
class BounceLimit {
 public:
  static constexpr int kMostTries = 5;

  /// Starts a step and discards the data of the last one. The indices of movers in further calls are those of `movers`.
  void begin(std::span<const Mover> movers);
  /// Records that two movers touch; `bounces`: with restitution.
  void join(std::size_t a, std::size_t b, bool bounces);
  [[nodiscard]] bool any() const noexcept { return any_; }

  /// Compares the energy of the movers before (with the velocity that forces add) and after the impulses. Returns
  /// whether some islands gained energy; then factor() is lower than before. `last`: there is no further try, and these
  /// islands do not bounce.
  bool lower(std::span<const Motion> before, std::span<const Motion> after, bool last);
  /// Factor of the restitution for the contacts of two movers, 0 .. 1.
  [[nodiscard]] btScalar factor(std::size_t a, std::size_t b) noexcept;

 private:
  /// Movers that are connected by contacts.
  struct Island {
    btScalar had_j = 0, gain_j = 0;
    btScalar factor = 1;
    btScalar last_factor = 0, last_gain_j = 0;  ///< of the previous try
    bool bounces = false, tried = false;
  };
  std::uint32_t root(std::size_t i) noexcept { return sets_.root(static_cast<std::uint32_t>(i)); }

  std::span<const Mover> movers_;
  DisjointSets sets_;            ///< of movers
  std::vector<Island> islands_;  ///< by root
  bool any_ = false;
};

/// J.
[[nodiscard]] btScalar kinetic_energy(const Mover& mover, const Motion& motion);

}  // namespace subworld::bullet
