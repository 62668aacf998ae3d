#pragma once

#include "model/body.hpp"

namespace subworld {

/// How deep two boxes overlap (m), by the separating-axis theorem: negative or zero if they do not. Both bodies must
/// have the shape `box`.
[[nodiscard]] double overlap_depth(const Body& a, const BodyState& at_a, const Body& b, const BodyState& at_b);

}  // namespace subworld
