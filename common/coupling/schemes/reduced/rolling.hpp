#pragma once

#include "model/body.hpp"

#include <optional>

namespace subworld {

/// The mass, kg, that a body has more where it rolls than where it slides: its moment of inertia about `axis` over its
/// radius squared. Nothing where it is not round about that axis. `axis`: in the world frame, of any length.
[[nodiscard]] std::optional<double> rolling_mass(const Body& body, const Quat& orientation, const Vec3& axis);

}  // namespace subworld
