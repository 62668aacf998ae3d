#include "physics/bullet/parts.hpp"

#include <cmath>

namespace subworld::bullet {

namespace {
constexpr double kBeside = 1e-3;  ///< distance at which parts count as touching, relative to their size
}  // namespace

Parts::Parts(btRigidBody& body, std::span<const BodyPart> parts, std::span<const MaterialPair> pairs,
             ShapeStore& shapes)
    : body_(body) {
  for (const BodyPart& part : parts) {
    poses_.emplace_back(to_bullet(part.pose.orientation), to_bullet(part.pose.position));
    btRigidBody::btRigidBodyConstructionInfo info(0, nullptr, shapes.get(part.shape));
    info.m_friction = scalar(std::sqrt(part.material.friction));
    info.m_restitution = scalar(part.material.restitution);
    all_.push_back(std::make_unique<btRigidBody>(info));
    all_.back()->setUserPointer(&body);
    if (pairs.empty()) continue;
    set_surface(*all_.back(), surfaces_.emplace_back(std::make_unique<Surface>(Surface{part.material, pairs})).get());
  }
  body.setUserPointer(this);
  follow();
  std::vector<Box> boxes;
  for (const auto& part : all_)
    boxes.push_back(box_of(*part).grown(kBeside * convex_of(*part->getCollisionShape()).outer_radius));
  beside_.resize(all_.size());
  for (std::uint32_t i = 0; i < boxes.size(); ++i) {
    for (std::uint32_t k = 0; k < boxes.size(); ++k) {
      if (i != k && boxes[i].meets(boxes[k])) beside_[i].push_back(k);
    }
  }
}

void Parts::follow() {
  const btTransform& pose = body_.getWorldTransform();
  for (std::size_t i = 0; i < all_.size(); ++i) {
    all_[i]->setWorldTransform(pose * poses_[i]);
    all_[i]->setLinearVelocity(body_.getVelocityInLocalPoint(pose.getBasis() * poses_[i].getOrigin()));
    all_[i]->setAngularVelocity(body_.getAngularVelocity());
  }
}

Box box_of(const btCollisionObject& object) {
  const btCollisionShape& shape = *object.getCollisionShape();
  const btTransform& pose = object.getWorldTransform();
  btVector3 lower, upper;
  if (!shape.isCompound()) {
    shape.getAabb(pose, lower, upper);
    return {from_bullet(lower), from_bullet(upper)};
  }
  const auto& compound = static_cast<const btCompoundShape&>(shape);
  Box box;
  for (int i = 0; i < compound.getNumChildShapes(); ++i) {
    compound.getChildShape(i)->getAabb(pose * compound.getChildTransform(i), lower, upper);
    const Box part{from_bullet(lower), from_bullet(upper)};
    i == 0 ? void(box = part) : box.extend(part);
  }
  return box;
}

}  // namespace subworld::bullet
