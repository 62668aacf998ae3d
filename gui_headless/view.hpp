#pragma once

#include "figure.hpp"

#include <Eigen/Core>

namespace subworld {

/// View and light of a figure, relative to its origin, in OpenGL's conventions.
struct View {
  Eigen::Matrix4f camera;
  Eigen::Matrix4f light;  ///< orthographic, from the key light
  Eigen::Vector3f eye;
  Eigen::Vector3f key_light;  ///< unit, towards the light
  Eigen::Vector3f fill_light;
  double light_width;   ///< width of the key light's view, m
  double ground_reach;  ///< m
};

[[nodiscard]] View view_of(const Figure& figure, PictureSize size);

}  // namespace subworld
