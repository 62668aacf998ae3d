#include "scene_update.hpp"

#include "joint_marks.hpp"
#include "model/trigonometry.hpp"
#include "written.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <string>
#include <utility>

namespace subworld::live {
namespace {

using Colour = std::array<double, 4>;
constexpr Colour kProxy{0.85, 0.12, 0.10, 1.0}, kMember{0.20, 0.40, 0.85, 1.0}, kBorder{0.95, 0.80, 0.15, 1.0},
    kOther{0.82, 0.82, 0.82, 1.0}, kFixed{0.55, 0.60, 0.65, 0.35}, kForce{0.85, 0.12, 0.10, 1.0},
    kJoint{kJointColour[0], kJointColour[1], kJointColour[2], 1.0};
constexpr double kPlane_m = 4.0, kThin_m = 1e-3, kLeastForce_n = 1e-3, kArrowWidth_m = 0.004;

std::vector<Colour> colours_of(const SceneDescription& scene, std::span<const UserView> users) {
  std::vector<Colour> colours;
  for (const Body& body : scene.bodies) colours.push_back(body.fixed() ? kFixed : kOther);
  const auto paint = [&](BodyId id, const Colour& colour) {
    if (index(id) < colours.size()) colours[index(id)] = colour;
  };
  for (const UserView& user : users) {
    for (const BoundaryContact& pair : user.border) {
      if (touches(pair)) paint(pair.inside, kBorder), paint(pair.outside, kBorder);
    }
  }
  for (const UserView& user : users)
    for (const BodyId member : user.members) paint(member, kMember);
  for (const UserView& user : users) paint(user.proxy, kProxy);
  return colours;
}

struct Block {
  Vec3 position;
  Quat orientation;
  Vec3 size;  ///< of an arrow: its length
  Colour colour;
};

/// What an entity consists of.
struct Primitives {
  std::vector<Block> arrows, cubes, spheres, cylinders;
  std::vector<std::pair<Block, const Mesh*>> triangles;

  void add(const Shape& shape, const BodyState& state, const Colour& colour, std::span<const Mesh> meshes) {
    const auto block = [&](double along_m, const Vec3& size) -> Block {
      return {state.position + state.orientation * Vec3(0.0, 0.0, along_m), state.orientation, size, colour};
    };
    const double wide = 2.0 * shape.radius;
    switch (shape.kind) {
      case ShapeKind::box:
        cubes.push_back(block(0.0, 2.0 * shape.half_extents));
        break;
      case ShapeKind::plane:
        cubes.push_back(block(-kThin_m / 2.0, {kPlane_m, kPlane_m, kThin_m}));
        break;
      case ShapeKind::sphere:
        spheres.push_back(block(0.0, Vec3::Constant(wide)));
        break;
      case ShapeKind::capsule:
        for (const double end : {shape.half_length, -shape.half_length})
          spheres.push_back(block(end, Vec3::Constant(wide)));
        [[fallthrough]];
      case ShapeKind::cylinder:
        cylinders.push_back(block(0.0, {wide, wide, 2.0 * shape.half_length}));
        break;
      case ShapeKind::convex:
      case ShapeKind::mesh:
      case ShapeKind::compound:
        if (shape.mesh < meshes.size()) triangles.emplace_back(block(0.0, Vec3::Zero()), &meshes[shape.mesh]);
    }
  }
};

Primitives joints_of(const SceneDescription& scene, std::span<const BodyState> states,
                     std::span<const std::uint32_t> broken) {
  Primitives joints;
  for (const JointMark& mark : joint_marks(scene.joints, scene.bodies, scene.meshes, broken)) {
    const Pose place = place_of(mark, states[index(mark.at)], states[index(mark.along)]);
    const bool is_rod = mark.form == JointMark::Form::rod;
    const double wide = 2.0 * mark.radius;
    auto& blocks = is_rod ? joints.cylinders : mark.form == JointMark::Form::sphere ? joints.spheres : joints.cubes;
    blocks.push_back({place.position, place.orientation, {wide, wide, is_rod ? 2.0 * mark.half_length : wide}, kJoint});
  }
  return joints;
}

void put_numbers(CdrWriter& cdr, const auto& numbers) {
  for (const double number : numbers) cdr("", number);
}
void put_pose(CdrWriter& cdr, const Block& one) {
  cdr("", one.position);
  put_numbers(cdr, std::array{one.orientation.x(), one.orientation.y(), one.orientation.z(), one.orientation.w()});
}

void put_entity(CdrWriter& cdr, const char* id, std::uint64_t time_ns, const Primitives& all) {
  constexpr std::uint32_t kNone = 0;
  cdr("", static_cast<std::uint32_t>(time_ns / 1'000'000'000));
  cdr("", static_cast<std::uint32_t>(time_ns % 1'000'000'000));
  for (const std::string text : {"world", id}) cdr("", text);
  cdr("", kNone);  // lifetime: until it is replaced
  cdr("", kNone);
  cdr("", false);  // frame_locked
  cdr("", kNone);  // metadata
  cdr.sequence("", all.arrows, [&](std::size_t, const Block& one) {
    put_pose(cdr, one);
    put_numbers(cdr, std::array{0.8 * one.size.x(), kArrowWidth_m, 0.2 * one.size.x(), 2.0 * kArrowWidth_m});
    put_numbers(cdr, one.colour);
  });
  for (const auto* blocks : {&all.cubes, &all.spheres, &all.cylinders}) {
    cdr.sequence("", *blocks, [&](std::size_t, const Block& one) {
      put_pose(cdr, one);
      cdr("", one.size);
      if (blocks == &all.cylinders) put_numbers(cdr, std::array{1.0, 1.0});
      put_numbers(cdr, one.colour);
    });
  }
  cdr("", kNone);  // lines
  cdr.sequence("", all.triangles, [&](std::size_t, const std::pair<Block, const Mesh*>& one) {
    const Mesh& mesh = *one.second;
    put_pose(cdr, one.first);
    cdr("", mesh.vertices);
    put_numbers(cdr, one.first.colour);
    cdr("", kNone);
    cdr("", static_cast<std::uint32_t>(3 * mesh.triangles.size()));
    for (const auto& corners : mesh.triangles) cdr("", corners);
  });
  cdr("", kNone);  // texts
  cdr("", kNone);  // models
}

}  // namespace

std::vector<std::uint8_t> scene_update(const SceneDescription& scene, std::span<const BodyState> states,
                                       std::span<const UserView> users, std::span<const Vec3> forces_n,
                                       std::span<const std::uint32_t> broken_joints, std::uint64_t time_ns) {
  const std::vector<Colour> colours = colours_of(scene, users);
  Primitives fixed, movable, forces;
  for (std::size_t i = 0; i < std::min(scene.bodies.size(), states.size()); ++i)
    (scene.bodies[i].fixed() ? fixed : movable).add(scene.bodies[i].shape, states[i], colours[i], scene.meshes);
  for (const UserView& user : users) {
    if (index(user.proxy) >= states.size() || index(user.user) >= forces_n.size()) continue;
    const Vec3& force_n = forces_n[index(user.user)];
    if (!(force_n.norm() > kLeastForce_n)) continue;
    const Quat along = turn_of_z(force_n.normalized()) * rotation_deg(Vec3::UnitY(), -90.0);  // an arrow points along x
    forces.arrows.push_back(
        {states[index(user.proxy)].position, along, Vec3(kArrow_m_per_n * force_n.norm(), 0.0, 0.0), kForce});
  }
  return written([&](CdrWriter& cdr) {
    cdr("", std::uint32_t{0});  // deletions
    cdr("", std::uint32_t{4});  // entities
    put_entity(cdr, "fixed", time_ns, fixed);
    put_entity(cdr, "bodies", time_ns, movable);
    put_entity(cdr, "forces", time_ns, forces);
    put_entity(cdr, "joints", time_ns, joints_of(scene, states, broken_joints));
  });
}

}  // namespace subworld::live
