#pragma once

#include "model/body.hpp"
#include "model/joint.hpp"
#include "model/settings/agreed_settings.hpp"
#include "model/settings/presence.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

/// `fields(archive, message)` describes what travels: names and order are those of the struct in the IDL. An archive
/// writes the fields, reads them (wire/cdr), or shows them, and says whether they are valid. A reader leaves a message
/// that is not valid half filled. `check` holds for readers alone: a writer sends everything, the receiver decides.
/// What stands in `archive.changes` travels in place of a list of the message (wire/changes).
namespace subworld {

/// A struct of the model, constant while it is written.
template <class T, class Struct>
concept Is = std::same_as<std::remove_const_t<T>, Struct>;

bool fields(auto& archive, Is<Pose> auto& m) {
  return archive("position", m.position) && archive("orientation", m.orientation);
}

bool motion_fields(auto& archive, Is<BodyState> auto& m) {
  return archive("position", m.position) && archive("orientation", m.orientation) &&
         archive("linear_velocity", m.linear_velocity) && archive("angular_velocity", m.angular_velocity);
}
bool fields(auto& archive, Is<StampedBody> auto& m) { return archive("body", m.id) && motion_fields(archive, m.state); }
/// Where it is known whose state it is.
bool fields(auto& archive, Is<BodyState> auto& m) {
  BodyId body{};
  return archive("body", body) && motion_fields(archive, m);
}
/// A state with the id that it must have.
template <class State>
struct StateOf {
  BodyId id;
  State& state;
};
template <class State>
StateOf(BodyId, State&) -> StateOf<State>;
template <class State>
bool fields(auto& archive, const StateOf<State>& m) {
  BodyId body = m.id;
  return archive("body", body) && archive.check(body == m.id) && motion_fields(archive, m.state);
}

bool fields(auto& archive, Is<Mesh> auto& m) {
  return archive("file", m.file) && archive("vertices", m.vertices) && archive("triangles", m.triangles) &&
         archive.check(std::ranges::all_of(m.triangles, [&](const auto& triangle) {
           return std::ranges::all_of(triangle, [&](std::uint32_t corner) { return corner < m.vertices.size(); });
         }));
}

bool fields(auto& archive, Is<Body> auto& m) {
  return archive("id", m.id) && archive("name", m.name) && archive("shape", m.shape.kind) &&
         archive("half_extents", m.shape.half_extents) && archive("radius", m.shape.radius) &&
         archive("half_length", m.shape.half_length) && archive("mesh", m.shape.mesh) &&
         archive("friction", m.material.friction) && archive("restitution", m.material.restitution) &&
         archive("mass", m.mass) && archive("inertia", m.inertia) && archive("gravity", m.gravity) &&
         archive("rotates", m.rotates) &&
         archive.check(m.shape.kind <= ShapeKind::compound && m.shape.half_extents.minCoeff() >= 0.0 &&
                       m.shape.radius >= 0.0 && m.shape.half_length >= 0.0 && m.material.friction >= 0.0 &&
                       m.material.restitution >= 0.0 && m.material.restitution <= 1.0 && m.mass >= 0.0 &&
                       m.inertia.minCoeff() >= 0.0);
}

bool fields(auto& archive, Is<NamedSetting> auto& m) { return archive("name", m.name) && archive("value", m.value); }

bool fields(auto& archive, Is<MissedStates> auto& m) {
  return archive("peer", m.peer) && archive("from_s", m.from_s) && archive.check(m.from_s >= 0.0) &&
         archive("to_s", m.to_s) && archive.check(m.from_s < m.to_s);
}

bool fields(auto& archive, Is<FollowedOrder> auto& m) {
  return archive("at_s", m.at_s) && archive.check(m.at_s >= 0.0) && archive("engine", m.engine);
}

struct Wrench {
  Vec3 force = Vec3::Zero();   ///< N
  Vec3 torque = Vec3::Zero();  ///< N m
};
bool fields(auto& archive, Is<Wrench> auto& m) { return archive("force", m.force) && archive("torque", m.torque); }

/// Version of the messages: it changes with each change of their layout or meaning. Programs of different versions
/// refuse to work together. Versions before had none; they begin with the length of a name, which is shorter.
inline constexpr std::uint32_t kWireVersion = 100'007;

/// What viewers show of a joint: where it is, and its free directions.
bool fields(auto& archive, Is<Joint> auto& m) {
  return archive("name", m.name) && archive("kind", m.kind) && archive("a", m.a) && archive("b", m.b) &&
         archive("in_a", m.in_a) && archive("in_b", m.in_b) && archive("x", m.axes[0].free) &&
         archive("y", m.axes[1].free) && archive("z", m.axes[2].free) && archive("turn_x", m.axes[3].free) &&
         archive("turn_y", m.axes[4].free) && archive("turn_z", m.axes[5].free) &&
         archive.check(m.kind <= JointKind::six);
}

/// Topic `scene`: all that a late joiner needs to create every body.
struct SceneDescription {
  std::uint32_t wire_version = kWireVersion;  ///< of another version nothing else is known
  std::string name;
  std::vector<NamedSetting> settings;  ///< programs with other ones refuse to work together
  std::uint64_t session = 0;           ///< drawn by the world
  std::uint32_t users = 0;             ///< haptic processes that take part
  std::vector<Mesh> meshes;
  std::vector<Body> bodies;
  std::vector<BodyState> states;  ///< of bodies[i] when the description was written
  std::vector<Joint> joints = {};
};
bool fields(auto& archive, Is<SceneDescription> auto& m) {
  return archive("wire_version", m.wire_version) && archive("name", m.name) && archive("settings", m.settings) &&
         archive("session", m.session) && archive("users", m.users) && archive("meshes", m.meshes) &&
         archive("bodies", m.bodies) &&
         archive.sequence("states", m.states,
                          [&](std::size_t i, auto& state) {
                            return archive("", StateOf{i < m.bodies.size() ? m.bodies[i].id : BodyId{}, state});
                          }) &&
         archive("joints", m.joints) && archive.check(m.states.size() == m.bodies.size()) &&
         archive.check(std::ranges::all_of(
             m.joints,
             [&](const Joint& joint) { return std::max(index(joint.a), index(joint.b)) < m.bodies.size(); })) &&
         archive.check(std::ranges::all_of(m.bodies, [&](const Body& body) {
           return body.shape.kind < ShapeKind::convex || body.shape.mesh < m.meshes.size();
         }));
}

}  // namespace subworld
