#include "view.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {
namespace {

constexpr double kNearestShare = 1e-3;  // near plane over far plane, limited by 24 bits of depth
constexpr double kLightReach = 1.6;     // in radii of the shown objects
constexpr double kGroundReach = 3.5;    // in radii of the shown objects

Eigen::Matrix4d view_matrix(const CameraAxes& axes, const Vec3& eye) {
  Eigen::Matrix4d view = Eigen::Matrix4d::Identity();
  view.row(0).head<3>() = axes.right;
  view.row(1).head<3>() = axes.up;
  view.row(2).head<3>() = -axes.forward;
  view.topRightCorner<3, 1>() = -(view.topLeftCorner<3, 3>() * eye);
  return view;
}

Eigen::Matrix4d perspective(double vertical_fov, double aspect, double near, double far) {
  const double focal = 1.0 / std::tan(vertical_fov / 2.0);
  Eigen::Matrix4d m = Eigen::Matrix4d::Zero();
  m(0, 0) = focal / aspect;
  m(1, 1) = focal;
  m(2, 2) = -(far + near) / (far - near);
  m(2, 3) = -2.0 * far * near / (far - near);
  m(3, 2) = -1.0;
  return m;
}

// A cube of half side `radius` around the origin, seen from the light.
Eigen::Matrix4d from_light(const Vec3& towards_light, double radius) {
  Eigen::Matrix4d m = view_matrix(axes_of({towards_light, Vec3::Zero(), 1.0}), Vec3::Zero()) / radius;
  m.row(2) = -m.row(2);
  m(3, 3) = 1.0;
  return m;
}

}  // namespace

View view_of(const Figure& figure, PictureSize size) {
  const auto axes = axes_of(figure.camera);
  const Vec3 eye = figure.camera.eye - figure.origin;
  const double radius = std::max(figure.movable.radius, 1e-6);
  const double reach = kGroundReach * radius;
  const double distance = -axes.forward.dot(eye);
  const double far = std::max(distance, 0.0) + 2.0 * reach;
  const double near = std::max(distance - 1.5 * reach, kNearestShare * far);
  const double aspect = static_cast<double>(size.width) / size.height;
  // The lights move with the camera, so that the visible sides are lit.
  const Vec3 key = (0.85 * Vec3::UnitZ() - 0.30 * axes.right - 0.38 * axes.forward).normalized();
  const Vec3 fill = (0.35 * Vec3::UnitZ() + 0.80 * axes.right - 0.30 * axes.forward).normalized();
  View view;
  view.camera = (perspective(figure.camera.vertical_fov_rad, aspect, near, far) * view_matrix(axes, eye)).cast<float>();
  view.light = from_light(key, kLightReach * radius).cast<float>();
  view.light_width = 2.0 * kLightReach * radius;
  view.eye = eye.cast<float>();
  view.key_light = key.cast<float>();
  view.fill_light = fill.cast<float>();
  view.ground_reach = reach;
  return view;
}

}  // namespace subworld
