#pragma once

#include "model/types.hpp"

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace subworld::ode {

/// Friction between two bodies in the previous sub-step, as a field over their contact points. Plain numbers, because
/// it is part of checkpoints.
struct Friction {
  std::uint32_t a, b;
  std::array<double, 3> centre;  ///< m
  std::array<double, 3> mean;    ///< impulse on a at each point, N s
  std::array<double, 3> spin;    ///< about the centre, N s per metre of arm
};

/// Stores the last friction of each pair. Without sliding, its direction is that of the load. Single points do not give
/// that direction, because their shares of a load are not unique.
class FrictionMemory {
 public:
  struct At {
    Vec3 point, normal, impulse;  ///< total impulse on a
  };

  void clear() noexcept { held_.clear(); }
  /// The points of one pair; call in ascending order of pairs. Stores the rigid field that fits their friction best.
  void remember(std::uint32_t a, std::uint32_t b, std::span<const At> points);
  void forget(std::uint32_t body);
  /// On body a at a place; zero for an unknown pair.
  [[nodiscard]] Vec3 recall(std::uint32_t a, std::uint32_t b, const Vec3& point) const;

  [[nodiscard]] const std::vector<Friction>& held() const noexcept { return held_; }
  void restore(std::vector<Friction> held) { held_ = std::move(held); }

 private:
  std::vector<Friction> held_;  ///< ordered by pairs
};

}  // namespace subworld::ode
