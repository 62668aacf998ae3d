#pragma once

#include "model/body.hpp"
#include "physics/bullet/shapes.hpp"
#include "physics/bullet/surface.hpp"

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace subworld::bullet {

/// The parts of a compound body as objects that only the search for contacts sees. Each has the velocity that it has as
/// a part, and its own material. What is found acts on the body.
class Parts {
 public:
  /// `pairs` outlive it.
  Parts(btRigidBody& body, std::span<const BodyPart> parts, std::span<const MaterialPair> pairs, ShapeStore& shapes);
  Parts(const Parts&) = delete;
  Parts& operator=(const Parts&) = delete;

  /// Moves the parts to where the body is, with its velocity.
  void follow();
  [[nodiscard]] std::span<const std::unique_ptr<btRigidBody>> all() const noexcept { return all_; }
  /// Numbers of the other parts that may touch this one.
  [[nodiscard]] std::span<const std::uint32_t> beside(std::size_t part) const noexcept { return beside_[part]; }

 private:
  btRigidBody& body_;
  std::vector<btTransform> poses_;  ///< in the body frame
  std::vector<std::unique_ptr<btRigidBody>> all_;
  std::vector<std::unique_ptr<Surface>> surfaces_;  ///< where there are pairs
  std::vector<std::vector<std::uint32_t>> beside_;
};

/// The parts of a body with a compound shape.
[[nodiscard]] inline const Parts& parts_of(const btCollisionObject& body) {
  return *static_cast<const Parts*>(body.getUserPointer());
}
/// The body of a part; any other body is its own.
[[nodiscard]] inline const btCollisionObject& owner_of(const btCollisionObject& object) {
  const bool part = object.getUserPointer() != nullptr && !object.getCollisionShape()->isCompound();
  return part ? *static_cast<const btCollisionObject*>(object.getUserPointer()) : object;
}

/// Around the shape; Bullet's box of a compound shape is too large.
[[nodiscard]] Box box_of(const btCollisionObject& object);

}  // namespace subworld::bullet
