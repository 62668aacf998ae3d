#include "physics/adapter.hpp"

#include "model/error.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstring>

namespace subworld {

namespace {

struct Header {
  std::array<char, 16> engine{};
  std::uint64_t bodies = 0;
};

Header header_of(std::string_view engine, std::size_t bodies) {
  Header header;
  std::copy_n(engine.begin(), std::min(engine.size(), header.engine.size()), header.engine.begin());
  header.bodies = bodies;
  return header;
}

}  // namespace

CollisionClass collision_class(Role role, bool fixed) noexcept {
  constexpr std::uint32_t kMovable = 1, kFixed = 2, kGhost = 4, kApproaching = 8;
  if (role == Role::ghost) return {kGhost, kMovable | kApproaching};
  if (role == Role::approaching) return {kApproaching, kMovable | kGhost | kApproaching};
  if (fixed) return {kFixed, kMovable};
  return {kMovable, kMovable | kFixed | kGhost | kApproaching};
}

const Mesh& mesh_of(const Shape& shape, std::span<const Mesh> meshes) {
  if (shape.mesh >= meshes.size()) {
    throw Error(ExitCode::usage,
                fmt::format("shape names mesh {} of {}; load the mesh with the scene", shape.mesh, meshes.size()));
  }
  return meshes[shape.mesh];
}

AdapterSlot::AdapterSlot(const Body& body, const Vec3& gravity)
    : id(index(body.id)),
      used(true),
      fixed(body.fixed()),
      rotates(body.rotates),
      group(body.group),
      shape_kind(body.shape.kind),
      material(body.material),
      surface_velocity(body.surface_velocity),
      surface_turn(body.surface_turn),
      mass(body.mass),
      inertia(body.inertia) {
  if (body.gravity && !body.fixed()) weight = body.mass * gravity;
}

void append(const void* from, std::size_t size, std::vector<std::byte>& to) {
  const auto* begin = static_cast<const std::byte*>(from);
  to.insert(to.end(), begin, begin + size);
}

SavedBody saved(const AdapterSlot& slot, const BodyState& state) {
  SavedBody entry{slot.id, {}, {}};
  Eigen::Map<Eigen::Matrix<double, 13, 1>>(entry.state.data()) << state.position, state.orientation.coeffs(),
      state.linear_velocity, state.angular_velocity;
  Eigen::Map<Eigen::Matrix<double, 10, 1>>(entry.load.data()) << (slot.fixed ? 0.0 : slot.mass), slot.inertia,
      slot.force, slot.torque;
  return entry;
}

BodyState restored(const SavedBody& saved, AdapterSlot& slot) {
  const Eigen::Map<const Eigen::Matrix<double, 13, 1>> x(saved.state.data());
  const Eigen::Map<const Eigen::Matrix<double, 10, 1>> load(saved.load.data());
  slot.mass = load[0];
  slot.inertia = load.segment<3>(1);
  slot.force = load.segment<3>(4);
  slot.torque = load.segment<3>(7);
  return {x.segment<3>(0), Quat(x[6], x[3], x[4], x[5]), x.segment<3>(7), x.segment<3>(10)};
}

void save_bodies(std::string_view engine, std::span<const SavedBody> bodies, std::vector<std::byte>& to) {
  const Header header = header_of(engine, bodies.size());
  append(&header, sizeof header, to);
  append(bodies.data(), bodies.size_bytes(), to);
}

std::vector<SavedBody> read_bodies(std::string_view engine, std::span<const std::byte>& saved) {
  Header header;
  if (saved.size() < sizeof header) refuse_checkpoint();
  std::memcpy(&header, saved.data(), sizeof header);
  saved = saved.subspan(sizeof header);
  if (header.engine != header_of(engine, 0).engine || header.bodies > saved.size() / sizeof(SavedBody)) {
    refuse_checkpoint();
  }
  std::vector<SavedBody> bodies(header.bodies);
  if (!bodies.empty()) std::memcpy(bodies.data(), saved.data(), bodies.size() * sizeof(SavedBody));
  saved = saved.subspan(bodies.size() * sizeof(SavedBody));
  return bodies;
}

void refuse_checkpoint() {
  throw Error(ExitCode::failed, "the checkpoint is of another engine or of other bodies; take one from this engine");
}

void refuse_body(BodyId id, const char* why) {
  throw Error(ExitCode::failed, fmt::format("body {} {}", index(id), why));
}

void refuse_body(std::string_view engine, const Body& body, std::string_view why) {
  const std::string name = body.name.empty() ? fmt::format("{}", index(body.id)) : body.name;  // messages have no names
  throw Error(ExitCode::usage, fmt::format("{} does not hold the body {}: it {}", engine, name, why));
}

void refuse_turning_friction(std::string_view engine, const Body& body, std::span<const MaterialPair> pairs) {
  const auto resists = [](const MaterialPair& p) { return p.rolling_friction || p.spinning_friction; };
  if (resists_turning(body.material) || std::ranges::any_of(pairs, resists))
    refuse_body(engine, body,
                resists_turning(body.material)
                    ? "has a material with rolling or spinning friction; use bullet or bullet_float"
                    : "is in a scene with a pair that has rolling or spinning friction; use bullet or bullet_float");
}

void refuse_pairs(std::string_view engine) {
  throw Error(ExitCode::usage, fmt::format("{} has no pairs of materials; use bullet, bullet_float or ode", engine));
}

void refuse_joints(std::string_view engine) {
  throw Error(ExitCode::usage, fmt::format("{} has no joints; use bullet or bullet_float", engine));
}

}  // namespace subworld
