#pragma once

#include <BulletCollision/CollisionDispatch/btCollisionObject.h>
#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>

#include <cstddef>

namespace subworld::bullet {

/// Where a part of a compound body lies against another one, its face is inside the body and touches nothing: the top
/// of a hole below its chamfer, the sides of two planks that form one floor. Removes the points of the manifold, which
/// are of part number `part`, that another part covers.
void omit_hidden(btPersistentManifold& manifold, const btCollisionObject& compound, std::size_t part);

}  // namespace subworld::bullet
