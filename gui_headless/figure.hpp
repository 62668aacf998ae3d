#pragma once

#include "picture.hpp"

#include <array>
#include <cstdint>
#include <map>
#include <vector>

/// Contents of a picture, computed without OpenGL: the shapes with their poses, colours and layers.
namespace subworld {

using Colour = std::array<float, 3>;  ///< sRGB, 0 .. 1

inline constexpr Colour kProxyColour{0.86F, 0.12F, 0.10F};
inline constexpr Colour kMemberColour{0.16F, 0.42F, 0.84F};
inline constexpr Colour kBorderColour{0.98F, 0.77F, 0.08F};
inline constexpr Colour kOtherColour{0.85F, 0.86F, 0.87F};
inline constexpr Colour kFixedColour{0.66F, 0.71F, 0.76F};
inline constexpr Colour kLineColour{0.80F, 0.02F, 0.06F};

/// Triangles of an instance: one of the unit shapes, or `file + i` for the i-th mesh of the picture.
enum class Model : std::uint32_t { sphere, box, capsule, cylinder, cone, file };

/// A model with its pose, laid out as the vertex shader reads it. Positions are relative to `Figure::origin`.
struct Instance {
  std::array<float, 3> position{};
  std::array<float, 4> orientation{0.0F, 0.0F, 0.0F, 1.0F};  ///< x, y, z, w
  std::array<float, 3> scale{1.0F, 1.0F, 1.0F};
  float half_length = 0.0F;
  Colour colour{};
};

using Batch = std::map<Model, std::vector<Instance>>;

struct Ground {
  Vec3 origin = Vec3::Zero();  ///< point of the plane around which the grid fades out, relative to `Figure::origin`
  Quat orientation = Quat::Identity();
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();  ///< of `origin` in the plane's own grid
};

struct Figure {
  Camera camera;
  Vec3 origin = Vec3::Zero();  ///< reference point of all drawn positions, so that floats are precise enough
  Ball movable;                ///< objects of the automatic camera, in world coordinates
  Batch proxies;
  Batch members;  ///< border bodies included
  Batch others;   ///< includes fixed bodies that are not boxes
  Batch glass;
  Batch lines;
  Batch halos;
  std::vector<Ground> grounds;
  double line_m_per_n_s = 0.0;
  double grid_m = 1.0;
  std::size_t omitted = 0;
};

/// Whether the inside body of the pair is a member. At a contact that may come soon it may be a ghost.
[[nodiscard]] bool pushes_member(const UserView& user, const BoundaryContact& pair);

/// Throws `Error` (usage) if the given camera is invalid.
[[nodiscard]] Figure compose(const Picture& picture, PictureSize size);

}  // namespace subworld
