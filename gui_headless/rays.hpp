#pragma once

#include "figure.hpp"

#include <array>
#include <limits>
#include <utility>

namespace subworld {

inline constexpr float kNone = std::numeric_limits<float>::infinity();

struct Ray {
  Eigen::Vector3f from, along;
};

/// Rays of samples, by column and row: parallel, or from one point. `ahead` has the length 1, `right` and `down` that
/// of a sample, at distance 1 where the rays come from one point. The parameter of a ray is the depth along `ahead`.
struct View {
  Eigen::Vector3f eye, right, down, ahead;
  bool parallel = false;
  int width = 0, height = 0;

  /// In the frame of a solid.
  [[nodiscard]] View seen_from(const Solid& s) const {
    const auto to = s.turn.transpose();
    return {to * (eye - s.centre), to * right, to * down, to * ahead, parallel, width, height};
  }
  [[nodiscard]] Ray ray(int column, int row) const {
    const Eigen::Vector3f aside = (static_cast<float>(column) + 0.5F - 0.5F * static_cast<float>(width)) * right +
                                  (static_cast<float>(row) + 0.5F - 0.5F * static_cast<float>(height)) * down;
    return parallel ? Ray{eye + aside, ahead} : Ray{eye, ahead + aside};
  }
  /// Columns and rows, from and to, of the samples that a ball may cover. Nothing behind the eye.
  [[nodiscard]] std::array<int, 4> extent(const Eigen::Vector3f& centre, float radius) const;
};

/// Where a ray enters and leaves a box; {kNone, kNone}: it does not.
[[nodiscard]] std::pair<float, float> crossings(const Eigen::Vector3f& half, const Ray& ray);
/// Where a ray enters a solid, both in its frame; kNone: it does not.
[[nodiscard]] float enter(const Solid& solid, const Ray& ray);
/// A point of a solid's surface: the normal in its frame, and the distance to the nearest sharp edge, m.
[[nodiscard]] std::pair<Eigen::Vector3f, float> surface(const Solid& solid, const Eigen::Vector3f& at);

}  // namespace subworld
