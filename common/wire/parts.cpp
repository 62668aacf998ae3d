#include "wire/parts.hpp"

#include "model/scene.hpp"

#include <algorithm>
#include <cmath>

namespace subworld::parts {

namespace {

/// A unit quaternion whose norm is off by less than this is not changed, so that both ends of a topic have equal
/// numbers.
constexpr double kQuaternionExact = 1e-6;
/// A quaternion whose norm is off by more than this is invalid; between the two limits it is normalised.
constexpr double kQuaternionNear = 1e-2;

}  // namespace

void put(const Vec3& in, msg::Vector& out) { out = {in.x(), in.y(), in.z()}; }
void put(const Quat& in, msg::Quaternion& out) { out = {in.w(), in.x(), in.y(), in.z()}; }
void put(BodyId in, std::uint32_t& out) { out = index(in); }

bool get(double in, double& out) {
  out = in;
  return std::isfinite(in);
}

bool get_positive(double in, double& out) { return get(in, out) && in >= 0.0; }

bool get_ratio(std::uint32_t in, int& out) {
  out = static_cast<int>(std::min<std::uint32_t>(in, kMostRatio));
  return in >= 1 && in <= kMostRatio;
}

bool get(const msg::Vector& in, Vec3& out) {
  out = Vec3{in[0], in[1], in[2]};
  return out.allFinite();
}

bool get(const msg::Quaternion& in, Quat& out) {
  out = Quat{in[0], in[1], in[2], in[3]};
  const double off = std::abs(out.squaredNorm() - 1.0);
  if (!(off <= kQuaternionNear)) return false;
  if (off > kQuaternionExact) out.normalize();
  return true;
}

bool get(std::uint32_t in, BodyId& out) {
  out = BodyId{in};
  return true;
}

void put(const Pose& in, msg::Pose& out) {
  put(in.position, out.position());
  put(in.orientation, out.orientation());
}

bool get(const msg::Pose& in, Pose& out) {
  return get(in.position(), out.position) && get(in.orientation(), out.orientation);
}

void put(const Wrench& in, msg::Wrench& out) {
  put(in.force, out.force());
  put(in.torque, out.torque());
}

bool get(const msg::Wrench& in, Wrench& out) { return get(in.force(), out.force) && get(in.torque(), out.torque); }

void put(BodyId id, const BodyState& in, msg::State& out) {
  out.body(index(id));
  put(in.position, out.position());
  put(in.orientation, out.orientation());
  put(in.linear_velocity, out.linear_velocity());
  put(in.angular_velocity, out.angular_velocity());
}

bool get(const msg::State& in, BodyState& out) {
  return get(in.position(), out.position) && get(in.orientation(), out.orientation) &&
         get(in.linear_velocity(), out.linear_velocity) && get(in.angular_velocity(), out.angular_velocity);
}

void put(const StampedBody& in, msg::State& out) { put(in.id, in.state, out); }

bool get(const msg::State& in, StampedBody& out) {
  out.id = BodyId{in.body()};
  return get(in, out.state);
}

void put(const std::array<std::uint32_t, 3>& in, msg::Triangle& out) { out.vertex() = in; }

bool get(const msg::Triangle& in, std::array<std::uint32_t, 3>& out) {
  out = in.vertex();
  return true;
}

void put(const Vec3& in, msg::Point& out) { put(in, out.position()); }
bool get(const msg::Point& in, Vec3& out) { return get(in.position(), out); }

void put(const Mesh& in, msg::Mesh& out) {
  out.file(in.file);
  put_all(in.vertices, out.vertices());
  put_all(in.triangles, out.triangles());
}

bool get(const msg::Mesh& in, Mesh& out) {
  out.file = in.file();
  if (!get_all(in.vertices(), out.vertices) || !get_all(in.triangles(), out.triangles)) return false;
  for (const auto& triangle : out.triangles) {
    for (const std::uint32_t corner : triangle) {
      if (corner >= out.vertices.size()) return false;
    }
  }
  return true;
}

void put(const Body& in, msg::Body& out) {
  out.id(index(in.id));
  out.name(in.name);
  out.shape(static_cast<std::uint8_t>(in.shape.kind));
  put(in.shape.half_extents, out.half_extents());
  out.radius(in.shape.radius);
  out.half_length(in.shape.half_length);
  out.mesh(in.shape.mesh);
  out.friction(in.material.friction);
  out.restitution(in.material.restitution);
  out.mass(in.mass);
  put(in.inertia, out.inertia());
  out.gravity(in.gravity);
  out.rotates(in.rotates);
}

bool get(const msg::Body& in, Body& out) {
  if (in.shape() > static_cast<std::uint8_t>(ShapeKind::mesh)) return false;
  out.id = BodyId{in.id()};
  out.name = in.name();
  out.shape.kind = static_cast<ShapeKind>(in.shape());
  out.shape.mesh = in.mesh();
  out.gravity = in.gravity();
  out.rotates = in.rotates();
  return get(in.half_extents(), out.shape.half_extents) && (out.shape.half_extents.array() >= 0.0).all() &&
         get_positive(in.radius(), out.shape.radius) && get_positive(in.half_length(), out.shape.half_length) &&
         get_positive(in.friction(), out.material.friction) &&
         get_positive(in.restitution(), out.material.restitution) && out.material.restitution <= 1.0 &&
         get_positive(in.mass(), out.mass) && get(in.inertia(), out.inertia) && (out.inertia.array() >= 0.0).all();
}

void put(const EnteringBody& in, msg::EnteringBody& out) {
  put(in.body, out.body());
  put(in.body.id, in.state, out.state());
}

bool get(const msg::EnteringBody& in, EnteringBody& out) {
  return in.state().body() == in.body().id() && get(in.body(), out.body) && get(in.state(), out.state);
}

void put(const BoundaryContact& in, msg::BoundaryContact& out) {
  out.inside(index(in.inside));
  out.outside(index(in.outside));
  put(in.point, out.point());
  put(in.normal, out.normal());
  out.distance(in.distance);
  out.normal_impulse(in.normal_impulse);
  put(in.tangential_impulse, out.tangential_impulse());
}

bool get(const msg::BoundaryContact& in, BoundaryContact& out) {
  out.inside = BodyId{in.inside()};
  out.outside = BodyId{in.outside()};
  return get(in.point(), out.point) && get(in.normal(), out.normal) && get(in.distance(), out.distance) &&
         get(in.normal_impulse(), out.normal_impulse) && get(in.tangential_impulse(), out.tangential_impulse);
}

void put(const Eigen::Matrix3d& in, msg::SymmetricTensor& out) {
  out.xx(in(0, 0));
  out.yy(in(1, 1));
  out.zz(in(2, 2));
  out.xy(in(0, 1));
  out.yz(in(1, 2));
  out.zx(in(2, 0));
}

/// Refuses an inertia that no body can have.
bool get(const msg::SymmetricTensor& in, Eigen::Matrix3d& out) {
  out << in.xx(), in.xy(), in.zx(), in.xy(), in.yy(), in.yz(), in.zx(), in.yz(), in.zz();
  return out.allFinite() && out.llt().info() == Eigen::Success;
}

void put(const CarriedBody& in, msg::CarriedBody& out) {
  out.mass_kg(in.mass_kg);
  put(in.centre_m, out.centre_m());
  put(in.inertia_kg_m2, out.inertia_kg_m2());
  put(in.drive, out.drive());
}

bool get(const msg::CarriedBody& in, CarriedBody& out) {
  return get_positive(in.mass_kg(), out.mass_kg) && out.mass_kg > 0.0 && get(in.centre_m(), out.centre_m) &&
         get(in.inertia_kg_m2(), out.inertia_kg_m2) && get(in.drive(), out.drive);
}

void put(const GhostAxis& in, msg::GhostAxis& out) {
  put(in.normal, out.normal());
  out.force_n(in.force_n);
  out.coulomb_limit_n(in.coulomb_limit_n);
  put(in.load_dependent_friction, out.load_dependent_friction());
}

bool get(const msg::GhostAxis& in, GhostAxis& out) {
  return get(in.normal(), out.normal) && get(in.force_n(), out.force_n) &&
         get_positive(in.coulomb_limit_n(), out.coulomb_limit_n) &&
         get(in.load_dependent_friction(), out.load_dependent_friction);
}

void put_ghosts(const std::vector<GhostModel>& in, msg::WorldFrame& out) {
  out.ghosts().resize(in.size());
  out.ghost_axes().resize(kMostGhostAxes * in.size());
  out.carried_bodies().resize(in.size());
  std::size_t axes = 0;
  std::size_t carried = 0;
  for (std::size_t g = 0; g < in.size(); ++g) {
    const GhostModel& ghost = in[g];
    msg::Ghost& wire = out.ghosts()[g];
    wire.outside(index(ghost.outside));
    wire.mass_kg(ghost.mass_kg);
    put(ghost.load_n, wire.load_n());
    wire.axis_count(static_cast<std::uint8_t>(ghost.axis_count));
    wire.carried(ghost.carried.has_value());
    wire.approaching(ghost.approaching);
    for (std::size_t i = 0; i < ghost.axis_count; ++i) put(ghost.axes[i], out.ghost_axes()[axes++]);
    if (ghost.carried) put(*ghost.carried, out.carried_bodies()[carried++]);
  }
  out.ghost_axes().resize(axes);
  out.carried_bodies().resize(carried);
}

bool get_ghosts(const msg::WorldFrame& in, std::vector<GhostModel>& out) {
  out.resize(in.ghosts().size());
  std::size_t axes = 0;
  std::size_t carried = 0;
  for (std::size_t g = 0; g < out.size(); ++g) {
    const msg::Ghost& wire = in.ghosts()[g];
    GhostModel& ghost = out[g];
    ghost.outside = BodyId{wire.outside()};
    ghost.axis_count = wire.axis_count();
    ghost.approaching = wire.approaching();
    if (ghost.axis_count > kMostGhostAxes || ghost.axis_count > in.ghost_axes().size() - axes ||
        !get_positive(wire.mass_kg(), ghost.mass_kg) || ghost.mass_kg == 0.0 || !get(wire.load_n(), ghost.load_n))
      return false;
    for (std::size_t i = 0; i < ghost.axis_count; ++i) {
      if (!get(in.ghost_axes()[axes++], ghost.axes[i])) return false;
    }
    ghost.carried.reset();
    if (!wire.carried()) continue;
    if (carried == in.carried_bodies().size() || !get(in.carried_bodies()[carried++], ghost.carried.emplace()))
      return false;
  }
  return axes == in.ghost_axes().size() && carried == in.carried_bodies().size();
}

void put(const PeerDevice& in, msg::PeerDevice& out) {
  out.proxy(index(in.proxy));
  put(in.pose, out.pose());
  put(in.linear_velocity, out.linear_velocity());
  put(in.angular_velocity, out.angular_velocity());
}

bool get(const msg::PeerDevice& in, PeerDevice& out) {
  out.proxy = BodyId{in.proxy()};
  return get(in.pose(), out.pose) && get(in.linear_velocity(), out.linear_velocity) &&
         get(in.angular_velocity(), out.angular_velocity);
}

void put(const Suppression& in, msg::Suppression& out) {
  out.until_stamp(in.until);
  put(in.place.lower, out.lower());
  put(in.place.upper, out.upper());
}

bool get(const msg::Suppression& in, Suppression& out) {
  out.until = in.until_stamp();
  return get(in.lower(), out.place.lower) && get(in.upper(), out.place.upper);
}

void put(const ReportedDevice& in, msg::ReportedDevice& out) {
  put(in.pose, out.pose());
  put(in.linear_velocity, out.linear_velocity());
  put(in.angular_velocity, out.angular_velocity());
  put(in.applied, out.applied());
}

bool get(const msg::ReportedDevice& in, ReportedDevice& out) {
  return get(in.pose(), out.pose) && get(in.linear_velocity(), out.linear_velocity) &&
         get(in.angular_velocity(), out.angular_velocity) && get(in.applied(), out.applied);
}

void put(const UserView& in, msg::UserView& out) {
  out.user(index(in.user));
  out.proxy(index(in.proxy));
  put_all(in.members, out.members());
  put_all(in.border, out.border());
  put(in.wrench, out.wrench());
}

bool get(const msg::UserView& in, UserView& out) {
  out.user = UserId{in.user()};
  out.proxy = BodyId{in.proxy()};
  return get_all(in.members(), out.members) && get_all(in.border(), out.border) && get(in.wrench(), out.wrench);
}

}  // namespace subworld::parts
