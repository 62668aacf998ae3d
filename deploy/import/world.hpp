#pragma once

#include "model/joint.hpp"
#include "model/types.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace subworld::import {

/// A world as its source describes it: what scene files and the formats that are read have in common. Poses are in the
/// world frame, if not stated otherwise.

/// Of a shape. The frictions against turning are lengths, as a scene's are. A contact has as many directions of force
/// as that of both surfaces which has more: with 4, it resists spinning, with 6 also rolling. The larger friction
/// holds.
struct Surface {
  double friction = 0.5;
  double restitution = 0.0;
  double spinning_friction = 0.0;  ///< m
  double rolling_friction = 0.0;   ///< m
  int directions = 3;
  auto operator<=>(const Surface&) const = default;
};

struct Geometry {
  enum class Kind : std::uint8_t { box, sphere, cylinder, capsule, plane, mesh };
  std::string name;
  Kind kind = Kind::box;
  Pose pose;                   ///< in the frame of its link
  Vec3 size = Vec3::Zero();    ///< sides of a box, m
  double radius = 0.0;         ///< m
  double length = 0.0;         ///< of a cylinder, and of the straight part of a capsule, m
  std::filesystem::path file;  ///< of a mesh
  double scale = 1.0;          ///< of a mesh
  bool is_hull = false;        ///< of a mesh: the source takes its convex hull too
  Surface surface;
};

struct Link {
  std::string name;
  Pose pose;
  bool fixed = false;
  double mass = 0.0;                                  ///< kg
  Vec3 centre = Vec3::Zero();                         ///< of mass, in the link's frame, m
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  ///< about it, along the link's axes, kg m^2
  std::vector<Geometry> shapes;
  std::string group;  ///< of links that do not collide with each other; empty: none
  bool gravity = true;
};

/// The axes of `frame` are those of Joint.
struct LinkJoint {
  std::string name;
  JointKind kind = JointKind::fixed;
  std::string a, b;  ///< links; empty: the world
  Pose frame;
  std::array<JointAxis, 6> axes;
};

/// Something of the source that the scene has not, or has otherwise.
struct Remark {
  int line = 0;  ///< 0: unknown
  std::string what;
};

struct World {
  std::string name;
  Vec3 gravity{0.0, 0.0, -9.81};
  std::vector<Link> links;
  std::vector<LinkJoint> joints;
  std::vector<Remark> remarks;

  void remark(int line, std::string what) { remarks.push_back({line, std::move(what)}); }
};

/// Both throw `Error` (usage) with the file, and the line where it is known.
[[nodiscard]] World read_sdf(const std::filesystem::path& file);  ///< also URDF
/// Meshes are written to `folder`.
[[nodiscard]] World read_mjcf(const std::filesystem::path& file, const std::filesystem::path& folder);

/// The scene file, with a user in front of it. Meshes are copied to the folder `meshes` beside it.
void write_scene(World& world, const std::filesystem::path& to);

}  // namespace subworld::import
