#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <span>

namespace subworld {

struct Material {
  double friction = 0.5;     ///< Coulomb's mu, static and sliding
  double restitution = 0.0;  ///< 0 .. 1
  /// Of the torques against rolling and against spinning about the normal: times the normal force they are the most, m.
  double rolling_friction = 0.0, spinning_friction = 0.0;
  std::uint32_t number = 0;  ///< in a scene with pairs, from 1; not in messages
};

[[nodiscard]] inline bool resists_turning(const Material& m) noexcept {
  return m.rolling_friction > 0.0 || m.spinning_friction > 0.0;
}

/// What holds where two materials touch, in place of what follows from both.
struct MaterialPair {
  std::uint32_t a = 0;  ///< number of a material
  std::uint32_t b = 0;
  std::optional<double> friction, restitution, rolling_friction, spinning_friction;
};

/// The geometric mean of the frictions, the product of the restitutions and the sums of the frictions against turning,
/// or what a pair says. `number` is 0.
[[nodiscard]] inline Material in_contact(const Material& a, const Material& b, std::span<const MaterialPair> pairs) {
  Material both{.friction = std::sqrt(a.friction * b.friction),
                .restitution = a.restitution * b.restitution,
                .rolling_friction = a.rolling_friction + b.rolling_friction,
                .spinning_friction = a.spinning_friction + b.spinning_friction};
  for (const MaterialPair& pair : pairs) {
    if ((pair.a != a.number || pair.b != b.number) && (pair.a != b.number || pair.b != a.number)) continue;
    both.friction = pair.friction.value_or(both.friction);
    both.restitution = pair.restitution.value_or(both.restitution);
    both.rolling_friction = pair.rolling_friction.value_or(both.rolling_friction);
    both.spinning_friction = pair.spinning_friction.value_or(both.spinning_friction);
  }
  return both;
}

}  // namespace subworld
