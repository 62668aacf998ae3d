#include "body.hpp"

#include <algorithm>

namespace subworld::ode {

namespace {

constexpr double kNoRotation = 1e20;  ///< kg m^2

}  // namespace

void make_body(Slot& slot, dWorldID world) {
  slot.body = dBodyCreate(world);
  dBodySetFiniteRotationMode(slot.body, 1);
  dBodySetGyroscopicMode(slot.body, 0);  // the adapter's own term conserves the energy
  set_mass(slot);
  for (const Piece& piece : slot.pieces) {
    dGeomSetBody(piece.geom, slot.body);
    if (slot.shape_kind != ShapeKind::compound) continue;
    const auto& [position, turn] = piece.part.pose;
    const dQuaternion wxyz{turn.w(), turn.x(), turn.y(), turn.z()};
    dGeomSetOffsetPosition(piece.geom, position.x(), position.y(), position.z());
    dGeomSetOffsetQuaternion(piece.geom, wxyz);
  }
}

void set_mass(Slot& slot) {
  // ODE has no infinite inertia. This value leaves 1e-20 of a torque; the step removes that too.
  const Vec3 inertia = slot.rotates ? slot.inertia : Vec3::Constant(kNoRotation);
  dMass mass;
  dMassSetParameters(&mass, slot.mass, 0, 0, 0, inertia.x(), inertia.y(), inertia.z(), 0, 0, 0);
  dBodySetMass(slot.body, &mass);
}

Eigen::Matrix3d inverse_inertia(const Slot& slot) {
  if (!slot.rotates || !slot.body) return Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d rotation = state_of(slot).orientation.toRotationMatrix();
  return rotation * slot.inertia.cwiseInverse().asDiagonal() * rotation.transpose();
}

BodyState state_of(const Slot& slot) {
  if (!slot.body) return slot.kept;
  const dReal* q = dBodyGetQuaternion(slot.body);
  return {from_ode(dBodyGetPosition(slot.body)), Quat(q[0], q[1], q[2], q[3]), from_ode(dBodyGetLinearVel(slot.body)),
          from_ode(dBodyGetAngularVel(slot.body))};
}

Pose pose_of(const Slot& slot, const Piece& piece) {
  const BodyState s = state_of(slot);
  return Pose{s.position, s.orientation} * piece.part.pose;
}

void set_velocity(Slot& slot, const Vec3& linear, const Vec3& angular) {
  if (slot.body) {
    dBodySetLinearVel(slot.body, linear.x(), linear.y(), linear.z());
    dBodySetAngularVel(slot.body, angular.x(), angular.y(), angular.z());
  } else {
    slot.kept.linear_velocity = linear;
    slot.kept.angular_velocity = angular;
  }
}

void place(Slot& slot, const BodyState& state) {
  const Vec3& p = state.position;
  const Quat& q = state.orientation;
  const dQuaternion wxyz{q.w(), q.x(), q.y(), q.z()};
  if (slot.body) {
    // dBodySetQuaternion() normalises and so changes the last bit: a restored body would differ from the saved one.
    // dBodySetPosition() updates the geometry.
    std::copy_n(wxyz, 4, const_cast<dReal*>(dBodyGetQuaternion(slot.body)));
    dRfromQ(const_cast<dReal*>(dBodyGetRotation(slot.body)), wxyz);
    dBodySetPosition(slot.body, p.x(), p.y(), p.z());
  } else if (slot.shape_kind == ShapeKind::plane) {
    const Vec3 normal = q * Vec3::UnitZ();
    dGeomPlaneSetParams(slot.pieces[0].geom, normal.x(), normal.y(), normal.z(), normal.dot(p));
  } else {
    for (const Piece& piece : slot.pieces) {
      const auto [at, turn] = Pose{p, q} * piece.part.pose;
      const dQuaternion turned{turn.w(), turn.x(), turn.y(), turn.z()};
      for (const dGeomID geom : {piece.geom, piece.back}) {
        if (geom == nullptr) continue;
        dGeomSetPosition(geom, at.x(), at.y(), at.z());
        dGeomSetQuaternion(geom, turned);
      }
    }
  }
  slot.kept = state;
  set_velocity(slot, state.linear_velocity, state.angular_velocity);
}

Vec3 velocity_at(const Slot& slot, const Vec3& point) {
  if (!slot.body) return Vec3::Zero();
  const BodyState s = state_of(slot);
  return s.linear_velocity + s.angular_velocity.cross(point - s.position);
}

Vec3 surface_velocity_at(const Slot& slot, const Vec3& point) {
  return slot.surface_velocity + slot.surface_turn.cross(point - slot.kept.position);
}

}  // namespace subworld::ode
