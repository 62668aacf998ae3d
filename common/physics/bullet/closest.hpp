#pragma once

#include "convex.hpp"

namespace subworld::bullet {

/// The points of two shapes' cores that are nearest to each other.
struct Closest {
  bool apart = false;  ///< else the cores overlap, and nothing else is known
  Vec3 on_a, on_b;     ///< of the cores as they were drawn in
  Vec3 from_b;         ///< on_a - on_b, with less rounding
};

/// Gilbert, Johnson and Keerthi 1988, in double precision. Cores are drawn to their centres so that a part is kept.
/// `guess`: about the direction from b to a.
[[nodiscard]] Closest closest(const Placed& a, double kept_a, const Placed& b, double kept_b, const Vec3& guess);

}  // namespace subworld::bullet
