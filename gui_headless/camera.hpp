#pragma once

#include "model/types.hpp"

#include <optional>
#include <span>

namespace subworld {

struct Camera {
  Vec3 eye{0.0, -1.0, 0.5};        ///< m
  Vec3 target = Vec3::Zero();      ///< m, in the middle of the picture
  double vertical_fov_rad = 0.45;  ///< from the lower to the upper edge of the picture
};

/// Right-handed unit axes of a camera. The world's z axis points up in the picture wherever possible.
struct CameraAxes {
  Vec3 right;
  Vec3 up;
  Vec3 forward;
};

/// Throws `Error` (usage) if eye and target coincide or the angle is not in (0, pi).
[[nodiscard]] CameraAxes axes_of(const Camera& camera);

/// Pixel coordinates (from the upper left) and size of the picture element there.
struct PicturePoint {
  double column = 0.0;
  double row = 0.0;
  double metres_per_pixel = 0.0;
};

/// Position of a point of the world in a picture of this size; empty if the point is behind the eye.
[[nodiscard]] std::optional<PicturePoint> project(const Camera& camera, int width, int height, const Vec3& point);

struct Ball {
  Vec3 centre = Vec3::Zero();
  double radius = 0.0;
};

/// A ball that contains all balls. Its centre is the middle of their bounds.
[[nodiscard]] Ball enclosing_ball(std::span<const Ball> balls) noexcept;

/// The camera with the largest view of all `balls` in a picture of width / height = `aspect`. It looks down obliquely,
/// and across the longest side of the objects, from the side that is nearer to `focus`.
[[nodiscard]] Camera fit_camera(std::span<const Ball> balls, const Vec3& focus, double aspect);

}  // namespace subworld
