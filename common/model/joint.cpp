#include "model/joint.hpp"

#include <algorithm>

namespace subworld {

namespace {

constexpr std::array<std::string_view, 8> kNames{"fixed",     "hinge",       "slider", "ball",
                                                 "universal", "cylindrical", "planar", "six"};

constexpr double kNearSquare = 1e-3;  ///< least cosine of the second of three turns

/// Of a rotation; its angle is at most pi.
Vec3 rotation_vector(Quat turn) noexcept {
  if (turn.w() < 0.0) turn.coeffs() = -turn.coeffs();
  const double sine = turn.vec().norm();
  const double factor = sine > 1e-9 ? 2.0 * std::atan2(sine, turn.w()) / sine : 2.0;
  return factor * turn.vec();
}

}  // namespace

std::string_view name_of(JointKind kind) noexcept { return kNames[static_cast<std::size_t>(kind)]; }

JointPlace place_of(const Joint& joint, const Pose& a, const Pose& b) noexcept {
  const Pose on_a = a * joint.in_a, on_b = b * joint.in_b;
  const Eigen::Matrix3d axes_a = on_a.orientation.toRotationMatrix(), axes_b = on_b.orientation.toRotationMatrix();
  JointPlace place;
  place.point = on_a.position;
  int free_turns = 0;
  for (int i = 0; i < 3; ++i) {
    place.directions[i] = place.directions[3 + i] = axes_b.col(i);
    place.coordinates[i] = axes_b.col(i).dot(on_a.position - on_b.position);
    free_turns += joint.axes[3 + i].free;
  }
  const auto is_free = [&](int i) { return joint.axes[3 + i % 3].free; };
  const auto set = [&](int i, double value) { place.coordinates[3 + i % 3] = value; };
  if (free_turns == 1) {
    const int k = is_free(0) ? 0 : is_free(1) ? 1 : 2, i = (k + 1) % 3, j = (k + 2) % 3;
    set(k, std::atan2(axes_a.col(i).dot(axes_b.col(j)), axes_a.col(i).dot(axes_b.col(i))));
    const Vec3 off = axes_b.col(k).cross(axes_a.col(k));
    set(i, off.dot(axes_b.col(i)));
    set(j, off.dot(axes_b.col(j)));
  } else if (free_turns == 2) {
    const int k = !is_free(0) ? 0 : !is_free(1) ? 1 : 2, i = (k + 1) % 3, j = (k + 2) % 3;
    set(i, std::atan2(axes_a.col(j).dot(axes_b.col(k)), axes_a.col(j).dot(axes_b.col(j))));
    set(j, std::atan2(axes_b.col(i).dot(axes_a.col(k)), axes_b.col(i).dot(axes_a.col(i))));
    set(k, -axes_b.col(i).dot(axes_a.col(j)));
    place.directions[3 + j] = axes_a.col(j);
    place.directions[3 + k] = axes_b.col(i).cross(axes_a.col(j)).normalized();
  } else if (free_turns == 3 && joint.kind == JointKind::six) {
    const Vec3 x = axes_b.col(0), z = axes_a.col(2);
    const double sine = std::clamp(x.dot(z), -1.0, 1.0);
    set(0, std::atan2(-axes_b.col(1).dot(z), axes_b.col(2).dot(z)));
    set(1, std::asin(sine));
    set(2, std::atan2(-x.dot(axes_a.col(1)), x.dot(axes_a.col(0))));
    const Vec3 y = z.cross(x) / std::max(std::sqrt(1.0 - sine * sine), kNearSquare);
    const double volume = std::max(x.dot(y.cross(z)), kNearSquare);
    place.directions[3] = y.cross(z) / volume;
    place.directions[4] = y;
    place.directions[5] = x.cross(y) / volume;
  } else {
    const Vec3 turn = rotation_vector(on_b.orientation.conjugate() * on_a.orientation);
    for (int i = 0; i < 3; ++i) set(i, turn[i]);
  }
  return place;
}

bool has_spring(const Joint& joint) noexcept {
  return std::ranges::any_of(joint.axes, [](const JointAxis& axis) { return axis.free && axis.stiffness > 0.0; });
}

double spring_energy(const Joint& joint, const Pose& a, const Pose& b) noexcept {
  const JointPlace place = place_of(joint, a, b);
  double sum = 0.0;
  for (std::size_t i = 0; i < joint.axes.size(); ++i) {
    const JointAxis& axis = joint.axes[i];
    const double off = place.coordinates[i] - axis.rest;
    if (axis.free) sum += 0.5 * axis.stiffness * off * off;
  }
  return sum;
}

}  // namespace subworld
