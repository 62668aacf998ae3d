#include "joint_marks.hpp"

#include "model/shapes/shape_extent.hpp"
#include "model/trigonometry.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

std::vector<JointMark> joint_marks(std::span<const Joint> joints, std::span<const Body> bodies,
                                   std::span<const Mesh> meshes, std::span<const std::uint32_t> broken) {
  using Form = JointMark::Form;
  std::vector<JointMark> marks;
  for (std::uint32_t j = 0; j < joints.size(); ++j) {
    const Joint& joint = joints[j];
    if (std::max(index(joint.a), index(joint.b)) >= bodies.size()) continue;
    if (std::ranges::find(broken, j) != broken.end()) continue;
    const auto radius = [&](BodyId id) { return bounding_radius(bodies[index(id)].shape, meshes); };
    const double size = std::min(radius(joint.a), radius(joint.b));
    const auto turns =
        std::count_if(joint.axes.begin() + 3, joint.axes.end(), [](const auto& axis) { return axis.free; });
    const auto add = [&](Form form, int axis, double thick, double half, double shift = 0.0) {
      // Directions are axes of b's frame; only the second one of two turns is an axis of a's (`JointPlace`).
      const bool on_a = axis >= 3 && turns == 2 && !joint.axes[3 + (axis + 1) % 3].free;
      const Vec3 direction = Vec3::Unit(axis % 3);
      marks.push_back({.joint = j,
                       .form = form,
                       .at = joint.a,
                       .along = on_a ? joint.a : joint.b,
                       .point = joint.in_a.position,
                       .turn = (on_a ? joint.in_a : joint.in_b).orientation * turn_of_z(direction),
                       .shift = size * shift,
                       .radius = size * thick,
                       .half_length = size * half});
    };
    if (turns == 3) add(Form::sphere, 2, 0.25, 0.0);
    for (int axis = 3; axis < 6 && turns < 3; ++axis)
      if (joint.axes[axis].free) add(Form::rod, axis, 0.045, 0.25);
    for (int axis = 0; axis < 3; ++axis) {
      if (!joint.axes[axis].free) continue;
      add(Form::rod, axis, 0.015, 0.45);
      for (const double end : {-0.45, 0.45}) add(Form::rod, axis, 0.06, 0.012, end);
    }
    if (marks.empty() || marks.back().joint != j) add(Form::cube, 2, 0.08, 0.0);
  }
  return marks;
}

Pose place_of(const JointMark& mark, const BodyState& at, const BodyState& along) noexcept {
  const Quat turn = along.orientation * mark.turn;
  return {at.position + at.orientation * mark.point + turn * Vec3(0.0, 0.0, mark.shift), turn};
}

}  // namespace subworld
