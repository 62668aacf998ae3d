#include "physics/bullet/contacts/contact_algorithm.hpp"
#include "physics/bullet/contacts/convex_contacts.hpp"
#include "physics/bullet/contacts/convex_points.hpp"
#include "physics/bullet/contacts/hidden_points.hpp"
#include "physics/bullet/parts.hpp"

#include <algorithm>
#include <vector>

extern btScalar gContactBreakingThreshold;

namespace subworld::bullet {

namespace {

btCollisionAlgorithmCreateFunc* part_and_plane = nullptr;

/// Contacts of the parts of a compound body with another one: each part has an algorithm while it is near.
class CompoundContacts final : public ContactAlgorithm {
 public:
  CompoundContacts(const btCollisionAlgorithmConstructionInfo& info, const btCollisionObject& a,
                   const btCollisionObject& b, bool swapped)
      : ContactAlgorithm(info, swapped), reach_(reach_of(a, b)) {
    near_.resize(parts_of(a).all().size());
  }
  ~CompoundContacts() override {
    for (btCollisionAlgorithm*& one : near_) forget(one);
  }
  void getAllContactManifolds(btManifoldArray& all) override {
    for (btCollisionAlgorithm* const one : near_) {
      if (one != nullptr) one->getAllContactManifolds(all);
    }
  }

  void processCollision(const btCollisionObjectWrapper* first, const btCollisionObjectWrapper* second,
                        const btDispatcherInfo& info, btManifoldResult* /*result*/) override {
    const auto [a, b] = ordered(first, second);
    const auto& one = static_cast<const btRigidBody&>(a);
    const auto& other = static_cast<const btRigidBody&>(b);
    const double speed = (one.getLinearVelocity() - other.getLinearVelocity()).length() + turning(one) + turning(other);
    const Box there = box_of(b).grown(reach_ + info.m_timeStep * speed);
    const auto wrap = [](const btCollisionObject& object) {
      return btCollisionObjectWrapper(nullptr, object.getCollisionShape(), &object, object.getWorldTransform(), -1, -1);
    };
    const btCollisionObjectWrapper wrapped_b = wrap(b);
    const auto parts = parts_of(a).all();
    for (std::size_t i = 0; i < parts.size(); ++i) {
      if (!box_of(*parts[i]).meets(there)) {
        forget(near_[i]);
        continue;
      }
      const btCollisionObjectWrapper wrapped = wrap(*parts[i]);
      if (near_[i] == nullptr) near_[i] = make(wrapped, wrapped_b);
      btManifoldResult result(&wrapped, &wrapped_b);
      near_[i]->processCollision(&wrapped, &wrapped_b, info, &result);
      found_.resizeNoInitialize(0);
      near_[i]->getAllContactManifolds(found_);
      for (int m = 0; m < found_.size(); ++m) omit_hidden(*found_[m], a, i);
    }
  }

 private:
  static double reach_of(const btCollisionObject& a, const btCollisionObject& b) {
    const auto size = [](const btCollisionObject& object) {
      return static_cast<double>(object.getCollisionShape()->getContactBreakingThreshold(gContactBreakingThreshold));
    };
    return std::min(size(a), size(b));
  }
  static double turning(const btRigidBody& body) {
    const btCollisionShape& shape = *body.getCollisionShape();
    return shape.getUserPointer() != nullptr ? body.getAngularVelocity().length() * convex_of(shape).outer_radius : 0.0;
  }

  btCollisionAlgorithm* make(const btCollisionObjectWrapper& part, const btCollisionObjectWrapper& other) {
    if (other.getCollisionShape()->getShapeType() != STATIC_PLANE_PROXYTYPE)
      return m_dispatcher->findAlgorithm(&part, &other, nullptr, BT_CONTACT_POINT_ALGORITHMS);
    // Bullet's own list of points, which boxes on a plane may have, knows no parts.
    btCollisionAlgorithmConstructionInfo info(m_dispatcher, 0);
    return part_and_plane->CreateCollisionAlgorithm(info, &part, &other);
  }
  void forget(btCollisionAlgorithm*& one) {
    if (one == nullptr) return;
    one->~btCollisionAlgorithm();
    m_dispatcher->freeCollisionAlgorithm(one);
    one = nullptr;
  }

  double reach_;                             ///< upper bound of the parts', m
  std::vector<btCollisionAlgorithm*> near_;  ///< by part; null: far
  btManifoldArray found_;                    ///< of one part
};

}  // namespace

void register_compound_contacts(btCollisionDispatcher& dispatcher, btCollisionAlgorithmCreateFunc& convex_and_plane) {
  static Make<CompoundContacts> compound(false), swapped(true);
  part_and_plane = &convex_and_plane;
  const auto both = [&](int other) {
    dispatcher.registerCollisionCreateFunc(COMPOUND_SHAPE_PROXYTYPE, other, &compound);
    dispatcher.registerCollisionCreateFunc(other, COMPOUND_SHAPE_PROXYTYPE, &swapped);
  };
  for (const int convex : kConvexShapes) both(convex);
  both(STATIC_PLANE_PROXYTYPE);
  both(TRIANGLE_MESH_SHAPE_PROXYTYPE);
  dispatcher.registerCollisionCreateFunc(COMPOUND_SHAPE_PROXYTYPE, COMPOUND_SHAPE_PROXYTYPE, &compound);
}

}  // namespace subworld::bullet
