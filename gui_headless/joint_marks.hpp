#pragma once

#include "model/body.hpp"
#include "model/joint.hpp"

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace subworld {

/// A solid that stands for a joint, or for a part of it. It moves with the joint's bodies.
struct JointMark {
  enum class Form : std::uint8_t {
    cube,    ///< half a side: radius
    sphere,  ///< radius
    rod      ///< a cylinder: radius, half length
  };
  std::uint32_t joint = 0;  ///< of the scene's
  Form form = Form::cube;
  BodyId at{};                   ///< the body that carries its place
  BodyId along{};                ///< the body that carries its orientation
  Vec3 point = Vec3::Zero();     ///< in the frame of `at`
  Quat turn = Quat::Identity();  ///< from its own axes, z along a rod, to those of `along`
  double shift = 0.0;            ///< from the point, along its own z, m
  double radius = 0.0;           ///< m
  double half_length = 0.0;      ///< m
};

inline constexpr std::array<float, 3> kJointColour{0.91F, 0.08F, 0.71F};  ///< sRGB

/// The marks of all joints but the broken ones, as large as the smaller one of the two bodies demands: a cube for a
/// joint without a free direction; a sphere for three free turns; else a short rod along the axis of each free turn,
/// and a long thin one, with a disc at each end, along each free slide. `bodies` by id.
[[nodiscard]] std::vector<JointMark> joint_marks(std::span<const Joint> joints, std::span<const Body> bodies,
                                                 std::span<const Mesh> meshes, std::span<const std::uint32_t> broken);

/// Centre and orientation of a mark in the world, with these states of its bodies.
[[nodiscard]] Pose place_of(const JointMark& mark, const BodyState& at, const BodyState& along) noexcept;

}  // namespace subworld
