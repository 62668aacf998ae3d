#include "camera.hpp"

#include "model/error.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

namespace subworld {
namespace {

constexpr double kMargin = 1.06;  // margin factor around the objects in the picture
constexpr double kDegree = std::numbers::pi / 180.0;

// The horizontal axis along which the balls extend, if they extend along one more than across it.
std::optional<Vec3> long_axis(std::span<const Ball> balls) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const auto& ball : balls) mean += ball.centre.head<2>() / static_cast<double>(balls.size());
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  double radius = 0.0;
  for (const auto& ball : balls) {
    const Eigen::Vector2d d = ball.centre.head<2>() - mean;
    spread += d * d.transpose() / static_cast<double>(balls.size());
    radius = std::max(radius, ball.radius);
  }
  // The principal axes in closed form: Eigen's solver for any size takes seconds to compile.
  const double mean_square = 0.5 * spread.trace(), half = 0.5 * (spread(0, 0) - spread(1, 1));
  const double apart = std::hypot(half, spread(0, 1)), angle = 0.5 * std::atan2(spread(0, 1), half);
  const double across = std::sqrt(std::max(0.0, mean_square - apart)), along = std::sqrt(mean_square + apart);
  if (along < 1.8 * across || along < 0.5 * radius) return std::nullopt;
  const Vec3 axis(std::cos(angle), std::sin(angle), 0.0);
  return axis.x() + 0.1 * axis.y() < 0.0 ? Vec3(-axis) : axis;
}

double elevation(std::span<const Ball> balls) {
  Box box{balls.front().centre, balls.front().centre};
  for (const auto& ball : balls) box.extend({ball.centre.array() - ball.radius, ball.centre.array() + ball.radius});
  const Vec3 size = box.upper - box.lower;
  return size.z() > 2.0 * size.head<2>().maxCoeff() ? 14.0 * kDegree : 32.0 * kDegree;
}

Vec3 turned(const Vec3& v, double angle) { return Eigen::AngleAxisd(angle, Vec3::UnitZ()) * v; }

// Viewing direction: `right` points to the right of the picture.
Vec3 look_along(const Vec3& right, double elevation) {
  const Vec3 ahead = Vec3::UnitZ().cross(right);
  return std::cos(elevation) * ahead - std::sin(elevation) * Vec3::UnitZ();
}

// A row may be seen from two sides, a heap from four. Turning a row exchanges its near and its far end, but not its
// direction in the picture.
std::vector<double> candidate_turns(bool row) {
  if (row) return {24.0 * kDegree, -24.0 * kDegree};
  return {28.0 * kDegree, 118.0 * kDegree, 208.0 * kDegree, 298.0 * kDegree};
}

Vec3 view_direction(std::span<const Ball> balls, const Vec3& focus) {
  const Vec3 aside = focus - enclosing_ball(balls).centre;
  const double down = elevation(balls);
  const auto axis = long_axis(balls);
  Vec3 best = Vec3::Zero();
  for (const double turn : candidate_turns(axis.has_value())) {
    const Vec3 other = look_along(turned(axis.value_or(Vec3::UnitX()), turn), down);
    // Only a clearly nearer focus changes the side. Otherwise a proxy in the middle would make the camera jump.
    if (best.isZero() || aside.dot(other - best) < -1e-3 * aside.norm()) best = other;
  }
  return best;
}

// Constraint of one pair of opposite picture edges: the eye may be at most this far along the view and this far
// sideways.
struct Fit {
  double along = 0.0;
  double aside = 0.0;
};

Fit fit_pair(std::span<const Ball> balls, const Vec3& side, const Vec3& forward, double tangent) {
  const double reach = std::hypot(1.0, tangent);
  double plus = -std::numeric_limits<double>::infinity();
  double minus = plus;
  for (const auto& ball : balls) {
    const double s = side.dot(ball.centre);
    const double f = tangent * forward.dot(ball.centre);
    plus = std::max(plus, s + ball.radius * reach - f);
    minus = std::max(minus, -s + ball.radius * reach - f);
  }
  return {-(plus + minus) / (2.0 * tangent), (plus - minus) / 2.0};
}

}  // namespace

CameraAxes axes_of(const Camera& camera) {
  const Vec3 forward = camera.target - camera.eye;
  const double angle = camera.vertical_fov_rad;
  if (!(forward.norm() > 0.0) || !forward.allFinite() || !(angle > 0.0 && angle < std::numbers::pi)) {
    throw Error(
        ExitCode::usage,
        fmt::format("camera with eye ({}, {}, {}), target ({}, {}, {}) and field of view {} rad: eye and target "
                    "must differ and the field of view lie between 0 and pi",
                    camera.eye.x(), camera.eye.y(), camera.eye.z(), camera.target.x(), camera.target.y(),
                    camera.target.z(), angle));
  }
  CameraAxes axes{Vec3::UnitX(), Vec3::UnitY(), forward.normalized()};
  const Vec3 right = axes.forward.cross(Vec3::UnitZ());
  if (right.norm() > 1e-6) axes.right = right.normalized();
  axes.up = axes.right.cross(axes.forward);
  return axes;
}

std::optional<PicturePoint> project(const Camera& camera, int width, int height, const Vec3& point) {
  const auto axes = axes_of(camera);
  const Vec3 d = point - camera.eye;
  const double depth = axes.forward.dot(d);
  if (!(depth > 0.0)) return std::nullopt;
  const double metres = 2.0 * depth * std::tan(camera.vertical_fov_rad / 2.0) / height;
  return PicturePoint{width / 2.0 + axes.right.dot(d) / metres, height / 2.0 - axes.up.dot(d) / metres, metres};
}

Ball enclosing_ball(std::span<const Ball> balls) noexcept {
  if (balls.empty()) return {Vec3::Zero(), 1.0};
  Box box{balls.front().centre, balls.front().centre};
  for (const auto& ball : balls) box.extend({ball.centre.array() - ball.radius, ball.centre.array() + ball.radius});
  Ball result{(box.lower + box.upper) / 2.0, 0.0};
  for (const auto& ball : balls)
    result.radius = std::max(result.radius, (ball.centre - result.centre).norm() + ball.radius);
  return result;
}

Camera fit_camera(std::span<const Ball> balls, const Vec3& focus, double aspect) {
  Camera camera;
  if (balls.empty()) return fit_camera({std::array{Ball{focus, 1.0}}}, focus, aspect);
  camera.target = balls.front().centre;
  camera.eye = camera.target - view_direction(balls, focus);
  const auto axes = axes_of(camera);
  const double tangent = std::tan(camera.vertical_fov_rad / 2.0) / kMargin;
  const Fit wide = fit_pair(balls, axes.right, axes.forward, tangent * aspect);
  const Fit high = fit_pair(balls, axes.up, axes.forward, tangent);
  const double along = std::min(wide.along, high.along);
  camera.eye = wide.aside * axes.right + high.aside * axes.up + along * axes.forward;
  const double distance = axes.forward.dot(enclosing_ball(balls).centre) - along;
  camera.target = camera.eye + std::max(distance, 1e-6) * axes.forward;
  return camera;
}

}  // namespace subworld
