#pragma once

#include "convex.hpp"

#include <array>
#include <cstddef>
#include <span>

namespace subworld::bullet {

/// Where two convex shapes touch, or nearly do: up to four points that they have in common, made new in each step from
/// the exact surfaces. Nothing is carried over but the choice among equals, so a point cannot wander.
struct PatchPoint {
  Vec3 on_b;        ///< on the surface of b, m
  double distance;  ///< between the surfaces along the normal, m
  int feature;      ///< the same for the same pair of corners or edges
};

struct Patch {
  static constexpr std::size_t kMost = 4;
  Vec3 normal = Vec3::UnitZ();  ///< unit, from b to a
  std::array<PatchPoint, kMost> points;
  std::size_t count = 0;

  [[nodiscard]] std::span<const PatchPoint> all() const { return {points.data(), count}; }
};

/// What is chosen stays chosen until another choice is better by more than noise: what is remembered of the last step.
struct PatchMemory {
  int face = -1;  ///< that carried the patch: of b, or of a if `of_a`
  bool of_a = false;
  bool separated = false;  ///< the shapes were apart along `normal`
  Vec3 normal = Vec3::Zero();
  std::array<int, Patch::kMost> features{-1, -1, -1, -1};
};

/// Points of two shapes that are less than `reach` (m) apart; `fine` (m) is what no choice depends on.
[[nodiscard]] Patch touch(const Placed& a, const Placed& b, double reach, double fine, PatchMemory& memory);

/// The same with the half-space below the plane `normal . x = offset` as b.
[[nodiscard]] Patch touch_plane(const Placed& a, const Vec3& normal, double offset, double reach, double fine,
                                PatchMemory& memory);

/// The largest distance that was found to lie between two shapes along a direction, which is no more than that between
/// them; negative: they overlap.
struct Gap {
  double distance = 0.0;        ///< m
  Vec3 normal = Vec3::UnitZ();  ///< from b to a
  Vec3 on_b = Vec3::Zero();     ///< m
};
[[nodiscard]] Gap gap_between(const Placed& a, const Placed& b, const Vec3& guess);

}  // namespace subworld::bullet
