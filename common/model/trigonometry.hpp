#pragma once

#include "model/types.hpp"

namespace subworld {

struct SinCos {
  double sin = 0.0;
  double cos = 1.0;
};

/// Sine and cosine of an angle in degrees, by additions and multiplications only. Equal bits on every machine, which
/// the C library does not guarantee (its code depends on the processor). Exact at multiples of 90; error below 1e-15.
[[nodiscard]] SinCos sin_cos_deg(double degrees) noexcept;

/// The rotation about a unit axis.
[[nodiscard]] Quat rotation_deg(const Vec3& axis, double degrees) noexcept;

/// The shortest turn of the z axis to a unit vector. Quat::FromTwoVectors does the same, and each source that uses it
/// compiles a singular value decomposition for the one case of opposite vectors.
[[nodiscard]] Quat turn_of_z(const Vec3& to) noexcept;

}  // namespace subworld
