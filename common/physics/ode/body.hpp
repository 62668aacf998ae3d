#pragma once

#include "physics/adapter.hpp"

#include <ode/ode.h>

#include <vector>

namespace subworld::ode {

inline Vec3 from_ode(const dReal* v) { return {v[0], v[1], v[2]}; }

/// A part of a compound body, or the whole of any other.
struct Piece {
  BodyPart part;
  dGeomID geom = nullptr;
  dGeomID back = nullptr;  ///< of a mesh, not in ODE's space: the same triangles seen from behind
};

struct Slot : AdapterSlot {
  std::vector<Piece> pieces;
  dBodyID body = nullptr;  ///< null: fixed
  BodyState kept;          ///< of a fixed body; of a body that does not rotate: its state before the step
};

/// Makes the dBody of a slot that has geometries.
void make_body(Slot& slot, dWorldID world);
/// Passes the slot's mass and inertia to ODE.
void set_mass(Slot& slot);
/// World frame, 1/(kg m^2); zero for a body that does not rotate.
[[nodiscard]] Eigen::Matrix3d inverse_inertia(const Slot& slot);

[[nodiscard]] BodyState state_of(const Slot& slot);
[[nodiscard]] Pose pose_of(const Slot& slot, const Piece& piece);
/// Exact: state_of() returns the same bits.
void place(Slot& slot, const BodyState& state);
void set_velocity(Slot& slot, const Vec3& linear, const Vec3& angular);
/// Velocity of a point of the body, m/s; zero for a fixed body.
[[nodiscard]] Vec3 velocity_at(const Slot& slot, const Vec3& point);
/// Of the surface of a fixed body there, m/s.
[[nodiscard]] Vec3 surface_velocity_at(const Slot& slot, const Vec3& point);

}  // namespace subworld::ode
