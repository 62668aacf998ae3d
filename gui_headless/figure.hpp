#pragma once

#include "picture.hpp"

#include <cstdint>
#include <vector>

/// Contents of a picture: solids with their poses, colours and layers.
namespace subworld {

using Colour = Eigen::Vector3f;  ///< sRGB, 0 .. 1

/// A solid to draw. Its position is relative to `Figure::origin`.
struct Solid {
  enum class Form : std::uint8_t {
    box,      ///< size: half sides
    capsule,  ///< size: radius, half length of the straight part, which is 0 in a sphere
    frustum,  ///< size: radius at the lower end, radius at the upper end, half length; a cylinder, or a cone
    triangle
  };
  /// From the most to the least important: a layer is translucent where an earlier one is behind it. Lines and their
  /// outlines are in front of all.
  enum class Layer : std::uint8_t { proxy, member, other, line, outline, glass };

  Form form = Form::box;
  Layer layer = Layer::other;
  Eigen::Vector3f centre = Eigen::Vector3f::Zero();
  Eigen::Matrix3f turn = Eigen::Matrix3f::Identity();  ///< from its own axes, z along it
  Eigen::Vector3f size = Eigen::Vector3f::Zero();      ///< m
  Eigen::Matrix3f triangle = Eigen::Matrix3f::Zero();  ///< from `centre`: a corner, and from it to the other two
  float radius = 0.0F;                                 ///< of the ball around `centre` that holds it, m
  Colour colour = Colour::Zero();
};

struct Ground {
  Eigen::Vector3f origin;  ///< point of the plane around which the grid fades out, relative to `Figure::origin`
  Eigen::Matrix3f turn;    ///< from the plane's axes, z up
  Eigen::Vector2d offset;  ///< of `origin` in the plane's own grid
};

struct Figure {
  Camera camera;
  Vec3 origin = Vec3::Zero();  ///< reference point of all drawn positions, so that floats are precise enough
  Ball movable;                ///< objects of the automatic camera, in world coordinates
  std::vector<Solid> solids;
  std::vector<Ground> grounds;
  double line_m_per_n_s = 0.0;
  double grid_m = 1.0;
  std::size_t omitted = 0;
};

/// Throws `Error` (usage) if the given camera is invalid.
[[nodiscard]] Figure compose(const Picture& picture, PictureSize size);

}  // namespace subworld
