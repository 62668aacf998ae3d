#pragma once

#include "body.hpp"
#include "friction.hpp"
#include "mesh_points.hpp"
#include "physics/contact_totals.hpp"
#include "shapes.hpp"

#include <compare>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace subworld::ode {

/// A piece of a body, as the data of its geometry.
struct Number {
  std::uint32_t body, piece;

  [[nodiscard]] std::uint64_t packed() const noexcept { return std::uint64_t{body} << 32 | piece; }
  [[nodiscard]] static Number of(dGeomID geom) {
    const std::uint64_t packed = reinterpret_cast<std::uintptr_t>(dGeomGetData(geom));
    return {static_cast<std::uint32_t>(packed >> 32), static_cast<std::uint32_t>(packed)};
  }
  [[nodiscard]] auto operator<=>(const Number&) const = default;
};

/// A contact point of two bodies, with shapes that are enlarged by 10 micrometres each.
struct ContactPoint {
  std::uint32_t a, b;
  const Material *on_a, *on_b;
  Vec3 point, normal;  ///< normal from b to a
  double distance;     ///< m, of the exact shapes
};

/// The contacts of one sub-step: find(), make_joints(), ODE's step, remove_joints(), collect().
class ContactPoints {
 public:
  /// `gravity`: m/s^2, for the threshold of speeds that a step removes.
  ContactPoints(dWorldID world, dSpaceID space, const std::vector<Slot>& slots, const ShapeStore& shapes,
                double gravity, std::span<const MaterialPair> pairs);
  ~ContactPoints() { dJointGroupDestroy(joints_); }
  ContactPoints(const ContactPoints&) = delete;
  ContactPoints& operator=(const ContactPoints&) = delete;

  /// Finds the contacts, ordered by bodies, independent of the order in ODE's space.
  void find();
  [[nodiscard]] std::span<const ContactPoint> found() const noexcept { return points_; }
  [[nodiscard]] std::span<const MaterialPair> material_pairs() const noexcept { return material_pairs_; }
  void make_joints(double h);
  void remove_joints() { dJointGroupEmpty(joints_); }
  /// Collects the impulses of the joints in a sub-step of h (s).
  void collect(double h, int substep, ContactTotals& totals);
  [[nodiscard]] FrictionMemory& frictions() noexcept { return frictions_; }
  [[nodiscard]] const FrictionMemory& frictions() const noexcept { return frictions_; }

 private:
  [[nodiscard]] Vec3 relative_velocity(const ContactPoint& at) const;
  [[nodiscard]] Vec3 friction_direction(const ContactPoint& at, const Vec3& velocity, double h) const;
  [[nodiscard]] Vec3 impulse_of(std::size_t i, double h) const;
  void remember_friction(double h);

  dWorldID world_;
  dSpaceID space_;
  const std::vector<Slot>& slots_;
  const ShapeStore& shapes_;
  double gravity_;
  std::vector<MaterialPair> material_pairs_;
  dJointGroupID joints_;
  std::vector<std::pair<Number, Number>> pairs_;
  std::vector<dContactGeom> found_;  ///< of one pair, in ODE's format
  MeshPoints mesh_points_;
  std::vector<ContactPoint> points_;
  std::vector<dJointFeedback> feedback_;  ///< of points_
  std::vector<FrictionMemory::At> pair_;  ///< the points of one pair
  FrictionMemory frictions_;
};

}  // namespace subworld::ode
