#include "physics/bullet/contacts/contact_points.hpp"

#include "physics/bullet/parts.hpp"

#include <optional>

namespace subworld::bullet {

std::span<const LastPoint> ManifoldWriter::take(std::array<LastPoint, kMostPoints>& into) {
  const auto count = static_cast<std::size_t>(manifold_.getNumContacts());
  for (std::size_t i = 0; i < count; ++i) {
    const btManifoldPoint& point = manifold_.getContactPoint(static_cast<int>(i));
    into[i] = {point.m_localPointB,
               point.m_appliedImpulse,
               point.m_appliedImpulseLateral1,
               point.m_appliedImpulseLateral2,
               point.m_index0,
               point.m_lifeTime,
               last_part_of(point)};
  }
  manifold_.clearManifold();
  return {into.data(), count};
}

// As btManifoldResult::addContactPoint, but the values common to all points are computed once, and points are written
// in place: members that are not set here have their initial values. Of points within the breaking threshold of each
// other, the last one remains. Friction comes from both materials, without Bullet's limit of 10.
void ManifoldWriter::put(const Points& found, const btCollisionObject& first, const btCollisionObject& second,
                         btScalar farthest) {
  const btTransform &pose_a = owner_of(first).getWorldTransform(), &pose_b = owner_of(second).getWorldTransform();
  btScalar friction = first.getFriction() * second.getFriction();
  btScalar restitution = btManifoldResult::calculateCombinedRestitution(&first, &second);
  if (const auto own = own_material(first, second)) {
    friction = scalar(own->friction);
    restitution = scalar(own->restitution);
  }
  btVector3 lateral_1, lateral_2;
  btPlaneSpace1(found.normal, lateral_1, lateral_2);
  for (std::size_t i = 0; i < found.count; ++i) {
    const auto& [on_b, distance, feature, aside] = found.points[i];
    if (distance > farthest) continue;
    const btVector3 on_a = on_b + found.normal * distance + aside;
    const btVector3 local_a = pose_a.invXform(on_a);
    btManifoldPoint& point = manifold_.getContactPoint(place_for(local_a));
    point.m_localPointA = local_a;
    point.m_localPointB = pose_b.invXform(on_b);
    point.m_positionWorldOnA = on_a;
    point.m_positionWorldOnB = on_b;
    point.m_normalWorldOnB = found.normal;
    point.m_distance1 = distance;
    point.m_combinedFriction = friction;
    point.m_combinedRestitution = restitution;
    point.m_combinedRollingFriction = point.m_combinedSpinningFriction = 0;
    point.m_index0 = feature;
    point.m_lateralFrictionDir1 = lateral_1;
    point.m_lateralFrictionDir2 = lateral_2;
    point.m_contactPointFlags = BT_CONTACT_FLAG_LATERAL_FRICTION_INITIALIZED;
    point.m_appliedImpulse = point.m_appliedImpulseLateral1 = point.m_appliedImpulseLateral2 = 0;
    set_last_part(point, {});
    point.m_lifeTime = 0;
  }
}

/// Index in the manifold of the point that is nearest on the first body within the breaking threshold, or of a new one.
int ManifoldWriter::place_for(const btVector3& local_a) {
  btScalar shortest = reach_ * reach_;
  int place = -1;
  for (int i = 0; i < manifold_.getNumContacts(); ++i) {
    const btScalar distance = (manifold_.getContactPoint(i).m_localPointA - local_a).length2();
    if (distance >= shortest) continue;
    shortest = distance;
    place = i;
  }
  if (place >= 0) return place;
  place = manifold_.getNumContacts();
  manifold_.setNumContacts(place + 1);
  return place;
}

void ManifoldWriter::go_on_from(std::span<const LastPoint> old) {
  std::array<bool, kMostPoints> given{};
  std::array<bool, kMostPoints> taken{};
  const auto take = [&](int to, std::size_t from) {
    btManifoldPoint& point = manifold_.getContactPoint(to);
    point.m_appliedImpulse = old[from].impulse;
    point.m_appliedImpulseLateral1 = old[from].lateral_1;
    point.m_appliedImpulseLateral2 = old[from].lateral_2;
    set_last_part(point, old[from].last_part);
    point.m_lifeTime = old[from].life_time + 1;
    given[static_cast<std::size_t>(to)] = taken[from] = true;
  };
  for (int i = 0; i < manifold_.getNumContacts(); ++i) {
    for (std::size_t k = 0; k < old.size(); ++k) {
      if (!taken[k] && old[k].feature == manifold_.getContactPoint(i).m_index0) {
        take(i, k);
        break;
      }
    }
  }
  for (int i = 0; i < manifold_.getNumContacts(); ++i) {
    if (given[static_cast<std::size_t>(i)]) continue;
    btScalar nearest = same_ * same_;
    std::optional<std::size_t> from;
    for (std::size_t k = 0; k < old.size(); ++k) {
      const btScalar distance = (old[k].local_b - manifold_.getContactPoint(i).m_localPointB).length2();
      if (taken[k] || distance >= nearest) continue;
      nearest = distance;
      from = k;
    }
    if (from) take(i, *from);
  }
}

Contact contact_of(const btRigidBody& a, const btRigidBody& b, const btManifoldPoint& point, double sign) {
  Contact contact;
  contact.a = BodyId{static_cast<std::uint32_t>(a.getUserIndex())};
  contact.b = BodyId{static_cast<std::uint32_t>(b.getUserIndex())};
  const btVector3& on_b = sign > 0.0 ? point.getPositionWorldOnB() : point.getPositionWorldOnA();
  contact.point = from_bullet(on_b);
  contact.normal = sign * from_bullet(point.m_normalWorldOnB);
  contact.distance = point.getDistance();
  contact.normal_impulse = point.m_appliedImpulse;
  contact.tangential_impulse = sign * from_bullet(point.m_appliedImpulseLateral1 * point.m_lateralFrictionDir1 +
                                                  point.m_appliedImpulseLateral2 * point.m_lateralFrictionDir2);
  return contact;
}

}  // namespace subworld::bullet
