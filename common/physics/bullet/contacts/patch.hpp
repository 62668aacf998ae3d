#pragma once

#include "physics/bullet/convex.hpp"

#include <array>
#include <cstddef>
#include <span>

namespace subworld::bullet {

/// Contact of two convex shapes, or of nearly touching ones: up to four common points, computed again in each step from
/// the exact surfaces. Only the choice among equal candidates is stored, so points cannot drift.
struct PatchPoint {
  Vec3 on_b;        ///< on the surface of b, m
  double distance;  ///< between the surfaces along the normal, m
  int feature;      ///< equal for the same pair of corners or edges
};

struct Patch {
  static constexpr std::size_t kMost = 4;
  Vec3 normal = Vec3::UnitZ();  ///< unit, from b to a
  std::array<PatchPoint, kMost> points;
  std::size_t count = 0;

  [[nodiscard]] std::span<const PatchPoint> all() const { return {points.data(), count}; }
};

/// Memory of the last step's choices, for hysteresis: a choice is replaced only by one that is better by more than
/// noise.
struct PatchMemory {
  int face = -1;  ///< the reference face: of b, or of a if `of_a`
  bool of_a = false;
  bool separated = false;  ///< the shapes were separate along `normal`
  Vec3 normal = Vec3::Zero();
  std::array<int, Patch::kMost> features{-1, -1, -1, -1};
};

/// Points of two shapes that are less than `reach` (m) apart; differences below `fine` (m) do not affect choices.
[[nodiscard]] Patch touch(const Placed& a, const Placed& b, double reach, double fine, PatchMemory& memory);

/// The same with the half-space below the plane `normal . x = offset` as b.
[[nodiscard]] Patch touch_plane(const Placed& a, const Vec3& normal, double offset, double reach, double fine,
                                PatchMemory& memory);

/// A lower bound of the distance of two shapes: the largest one found along any tested direction. Negative: they
/// overlap.
struct Gap {
  double distance = 0.0;        ///< m
  Vec3 normal = Vec3::UnitZ();  ///< from b to a
  Vec3 on_b = Vec3::Zero();     ///< m
};
[[nodiscard]] Gap gap_between(const Placed& a, const Placed& b, const Vec3& guess);

}  // namespace subworld::bullet
