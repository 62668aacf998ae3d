#pragma once

#include "model/types.hpp"

#include <optional>
#include <span>

namespace subworld {

struct Camera {
  Vec3 eye{0.0, -1.0, 0.5};        ///< m
  Vec3 target = Vec3::Zero();      ///< m, in the middle of the picture
  double vertical_fov_rad = 0.45;  ///< from the lower to the upper rim of the picture
};

/// Right-handed unit axes of a camera; z of the world points up in the picture wherever it can.
struct CameraAxes {
  Vec3 right;
  Vec3 up;
  Vec3 forward;
};

/// Throws `Error` (usage) if the camera looks nowhere or its angle is not in (0, pi).
[[nodiscard]] CameraAxes axes_of(const Camera& camera);

/// Pixel coordinates (from the upper left) and size of the picture element there.
struct PicturePoint {
  double column = 0.0;
  double row = 0.0;
  double metres_per_pixel = 0.0;
};

/// Where a point of the world is in a picture of that size; nothing if it lies behind the eye.
[[nodiscard]] std::optional<PicturePoint> project(const Camera& camera, int width, int height, const Vec3& point);

struct Ball {
  Vec3 centre = Vec3::Zero();
  double radius = 0.0;
};

/// The ball around the middle of all balls that holds them.
[[nodiscard]] Ball enclosing_ball(std::span<const Ball> balls) noexcept;

/// The camera that holds all `balls` as large as possible in a picture of width / height = `aspect`. It looks down
/// obliquely and across the longest side of what it sees, from the side where `focus` is nearer.
[[nodiscard]] Camera fit_camera(std::span<const Ball> balls, const Vec3& focus, double aspect);

}  // namespace subworld
