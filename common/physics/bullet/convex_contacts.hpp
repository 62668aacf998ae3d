#pragma once

#include <BulletCollision/CollisionDispatch/btCollisionDispatcher.h>
#include <BulletCollision/CollisionDispatch/btDefaultCollisionConfiguration.h>
#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>

namespace subworld::bullet {

/// Bullet's own, with room for the algorithms of this folder.
[[nodiscard]] btDefaultCollisionConstructionInfo collision_settings();

/// Fills the manifold of two convex bodies that are apart with the contact that they will have within this step, if
/// any: solved as "no nearer than the gap that is left", it stops them on this side. All corners that will be within
/// `way` (m) count, for the body shall not turn about the first.
void look_ahead(btPersistentManifold& manifold, const btCollisionObject& a, const btCollisionObject& b, double way,
                double dt);

/// Contacts of every pair of convex shapes but two boxes, and of them with planes and meshes, from the exact surfaces
/// (patch.hpp). The shapes must carry their Convex as a user pointer (ShapeStore).
void register_convex_contacts(btCollisionDispatcher& dispatcher);

}  // namespace subworld::bullet
