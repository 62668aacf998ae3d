#pragma once

#include "model/body.hpp"

#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include <optional>
#include <span>

namespace subworld::bullet {

/// What Bullet's numbers do not tell of the surface of a body or of a part. Plain surfaces have none.
struct Surface {
  Material material;
  std::span<const MaterialPair> pairs;         ///< of the scene
  btVector3 velocity{0, 0, 0}, turn{0, 0, 0};  ///< of the surface on the body, at and about its origin
};

inline void set_surface(btCollisionObject& object, Surface* surface) { object.internalSetExtensionPointer(surface); }
/// Null: plain.
[[nodiscard]] inline const Surface* surface_of(const btCollisionObject& object) {
  return static_cast<const Surface*>(object.internalGetExtensionPointer());
}

/// Of two surfaces that touch, if Bullet's product of both does not hold.
[[nodiscard]] inline std::optional<Material> own_material(const btCollisionObject& a, const btCollisionObject& b) {
  const Surface *of_a = surface_of(a), *of_b = surface_of(b);
  if (of_a == nullptr || of_b == nullptr || of_a->pairs.empty()) return std::nullopt;
  return in_contact(of_a->material, of_b->material, of_a->pairs);
}

/// Lengths, m: times the normal force they are the largest torques against turning.
struct Resistance {
  btScalar rolling = 0, spinning = 0;
};
[[nodiscard]] inline Resistance resistance(const btPersistentManifold& manifold) {
  const Surface *of_a = surface_of(*manifold.getBody0()), *of_b = surface_of(*manifold.getBody1());
  if (of_a == nullptr && of_b == nullptr) return {};
  const Material plain{};
  const Material both =
      in_contact(of_a ? of_a->material : plain, of_b ? of_b->material : plain, of_a ? of_a->pairs : of_b->pairs);
  return {static_cast<btScalar>(both.rolling_friction), static_cast<btScalar>(both.spinning_friction)};
}

/// How fast the first body's surface slides over the second one's at a point, m/s, while both bodies are at rest.
[[nodiscard]] inline btVector3 sliding(const btPersistentManifold& manifold, const btVector3& point) {
  btVector3 speed(0, 0, 0);
  const auto add = [&](const btCollisionObject& object, btScalar sign) {
    if (const Surface* surface = surface_of(object))
      speed += sign * (surface->velocity + surface->turn.cross(point - object.getWorldTransform().getOrigin()));
  };
  add(*manifold.getBody0(), 1);
  add(*manifold.getBody1(), -1);
  return speed;
}

/// How fast the first body's surface turns against the second one's, rad/s, while both bodies are at rest.
[[nodiscard]] inline btVector3 turning(const btPersistentManifold& manifold) {
  const Surface *of_a = surface_of(*manifold.getBody0()), *of_b = surface_of(*manifold.getBody1());
  return (of_a ? of_a->turn : btVector3(0, 0, 0)) - (of_b ? of_b->turn : btVector3(0, 0, 0));
}

}  // namespace subworld::bullet
