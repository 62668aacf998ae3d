#pragma once

#include "lab/random/structures.hpp"

namespace subworld {

/// Adds a user with a tool of its own, clear of all bodies, or with a movable body as its tool, and a way for its hand
/// that leads to a body and on. Bodies come before the first user.
void add_user(Draw& draw, Builder& builder, const BodyRanges& ranges, Scene& scene);

}  // namespace subworld
