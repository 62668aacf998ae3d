#pragma once

#include "physics/bullet/convex.hpp"

namespace subworld::bullet {

/// The nearest points of the cores of two shapes.
struct Closest {
  bool apart = false;  ///< false: the cores overlap, and the other members are not valid
  Vec3 on_a, on_b;     ///< points of the scaled cores
  Vec3 from_b;         ///< on_a - on_b, with less rounding error
};

/// Gilbert, Johnson and Keerthi 1988, in double precision. Each core is scaled about its centre by `kept_a`, `kept_b`.
/// `guess`: approximate direction from b to a.
[[nodiscard]] Closest closest(const Placed& a, double kept_a, const Placed& b, double kept_b, const Vec3& guess);

}  // namespace subworld::bullet
