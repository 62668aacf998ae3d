#pragma once

#include <BulletCollision/CollisionDispatch/btCollisionCreateFunc.h>
#include <BulletCollision/CollisionDispatch/btCollisionDispatcher.h>
#include <BulletCollision/CollisionDispatch/btDefaultCollisionConfiguration.h>
#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>

namespace subworld::bullet {

/// Bullet's settings, with memory for the algorithms of this folder.
[[nodiscard]] btDefaultCollisionConstructionInfo collision_settings();

/// For two separate convex bodies that will touch within this step: fills the manifold with that contact. The solver
/// then limits the approach to the remaining gap, so that the bodies do not pass each other. All corners within `way`
/// (m) are included, so that the body does not turn about the first one.
void look_ahead(btPersistentManifold& manifold, const btCollisionObject& a, const btCollisionObject& b, double way,
                double dt);

/// Registers contacts for every pair of convex shapes but two boxes, and for convex shapes with planes and meshes, from
/// the exact surfaces (patch.hpp). The shapes must have their Convex as user pointer (ShapeStore).
void register_convex_contacts(btCollisionDispatcher& dispatcher);
/// The part of register_convex_contacts() that is for meshes.
void register_mesh_contacts(btCollisionDispatcher& dispatcher);
/// The part of it that is for compound shapes. `convex_and_plane` makes the contacts of a part with a plane.
void register_compound_contacts(btCollisionDispatcher& dispatcher, btCollisionAlgorithmCreateFunc& convex_and_plane);

}  // namespace subworld::bullet
