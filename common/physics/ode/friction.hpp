#pragma once

#include "model/types.hpp"

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace subworld::ode {

/// What friction did between two bodies in the sub-step before, as a field over their points. Plain numbers: it goes
/// into checkpoints.
struct Friction {
  std::uint32_t a, b;
  std::array<double, 3> centre;  ///< m
  std::array<double, 3> mean;    ///< impulse on a at each point, N s
  std::array<double, 3> spin;    ///< about the centre, N s per metre of arm
};

/// Where nothing slides, last friction tells where the load pulls. Point by point it would not: the corners of a body
/// share a load as they like.
class FrictionMemory {
 public:
  struct At {
    Vec3 point, normal, impulse;  ///< on a, friction and all
  };

  void clear() noexcept { held_.clear(); }
  /// The points of one pair, in ascending order of pairs: keeps the rigid field nearest to their friction.
  void remember(std::uint32_t a, std::uint32_t b, std::span<const At> points);
  void forget(std::uint32_t body);
  /// On body a at a place; zero for a pair that is not known.
  [[nodiscard]] Vec3 recall(std::uint32_t a, std::uint32_t b, const Vec3& point) const;

  [[nodiscard]] const std::vector<Friction>& held() const noexcept { return held_; }
  void restore(std::vector<Friction> held) { held_ = std::move(held); }

 private:
  std::vector<Friction> held_;  ///< ordered by pairs
};

}  // namespace subworld::ode
