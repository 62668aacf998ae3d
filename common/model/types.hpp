#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstdint>

namespace subworld {

using Vec3 = Eigen::Vector3d;
using Quat = Eigen::Quaterniond;  ///< body frame to world frame, unit length

/// Index of a body in `Scene::bodies`; the same in every process.
enum class BodyId : std::uint32_t {};
/// Index of a user in `Scene::users`.
enum class UserId : std::uint32_t {};

constexpr std::uint32_t index(BodyId id) noexcept { return static_cast<std::uint32_t>(id); }
constexpr std::uint32_t index(UserId id) noexcept { return static_cast<std::uint32_t>(id); }

struct Pose {
  Vec3 position = Vec3::Zero();  ///< m
  Quat orientation = Quat::Identity();
};

/// A pose that is given in a frame, where that frame is.
[[nodiscard]] inline Pose operator*(const Pose& frame, const Pose& in_it) {
  return {frame.position + frame.orientation * in_it.position, frame.orientation * in_it.orientation};
}

/// Axis-aligned box.
struct Box {
  Vec3 lower = Vec3::Zero();  ///< m
  Vec3 upper = Vec3::Zero();  ///< m

  [[nodiscard]] bool meets(const Box& other) const noexcept {
    return (lower.array() <= other.upper.array()).all() && (other.lower.array() <= upper.array()).all();
  }
  [[nodiscard]] bool holds(const Box& other) const noexcept {
    return (lower.array() <= other.lower.array()).all() && (other.upper.array() <= upper.array()).all();
  }
  void extend(const Box& other) noexcept {
    lower = lower.cwiseMin(other.lower);
    upper = upper.cwiseMax(other.upper);
  }
  [[nodiscard]] Box grown(double by_m) const noexcept {
    return {lower - Vec3::Constant(by_m), upper + Vec3::Constant(by_m)};
  }
};

}  // namespace subworld
