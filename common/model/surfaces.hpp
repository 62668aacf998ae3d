#pragma once

#include "model/contact.hpp"
#include "model/scene/scene.hpp"

#include <algorithm>
#include <span>

namespace subworld {

[[nodiscard]] inline bool has_driven_surfaces(const Scene& scene) {
  return std::ranges::any_of(scene.bodies, &Body::is_driven);
}

/// Work of driven surfaces on the bodies that touch them, J, by the friction impulses of these contacts.
[[nodiscard]] inline double surface_work(const Scene& scene, std::span<const Contact> contacts) {
  double work_j = 0.0;
  for (const Contact& contact : contacts) {
    const auto add = [&](BodyId id, double sign) {
      const Body& body = scene.body(id);
      if (!body.is_driven()) return;
      const Vec3 arm = contact.point - scene.initial[index(id)].position;
      work_j += sign * contact.tangential_impulse.dot(body.surface_velocity + body.surface_turn.cross(arm));
    };
    add(contact.a, -1.0);  // the impulse is that on a
    add(contact.b, 1.0);
  }
  return work_j;
}

}  // namespace subworld
