#pragma once

#include "lab/random/structures.hpp"

namespace subworld {

/// Adds a user. The tool is a new one, clear of all bodies, or a movable body. The operator's path leads to a body and
/// beyond. Bodies must be added before the first user.
void add_user(Draw& draw, Builder& builder, const BodyRanges& ranges, Scene& scene);

}  // namespace subworld
