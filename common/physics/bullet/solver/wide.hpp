#pragma once

#include "physics/bullet/movers.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

/// Numbers of several pairs of bodies side by side, one pair in each lane, for the vector instructions of a processor.
/// Everything here is inlined into functions that are compiled for one processor or another: see ContactBatches.
namespace subworld::bullet {

#define SUBWORLD_WIDE [[gnu::always_inline]] inline

using Wide = btScalar __attribute__((vector_size(32), aligned(32)));
inline constexpr std::size_t kLanes = sizeof(Wide) / sizeof(btScalar);
/// For each lane an index.
using Lanes = std::array<std::uint32_t, kLanes>;

struct Wide3 {
  Wide x, y, z;
};
struct WideSymmetric {
  Wide xx, xy, xz, yy, yz, zz;
};

SUBWORLD_WIDE Wide3 operator+(const Wide3& a, const Wide3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
SUBWORLD_WIDE Wide3 operator-(const Wide3& a, const Wide3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
SUBWORLD_WIDE Wide3 operator*(const Wide& s, const Wide3& a) { return {s * a.x, s * a.y, s * a.z}; }
SUBWORLD_WIDE Wide3 operator*(const WideSymmetric& m, const Wide3& a) {
  return {m.xx * a.x + m.xy * a.y + m.xz * a.z, m.xy * a.x + m.yy * a.y + m.yz * a.z,
          m.xz * a.x + m.yz * a.y + m.zz * a.z};
}
SUBWORLD_WIDE Wide dot(const Wide3& a, const Wide3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
SUBWORLD_WIDE Wide3 cross(const Wide3& a, const Wide3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
SUBWORLD_WIDE Wide most_of(const Wide& a, const Wide& b) { return a > b ? a : b; }
SUBWORLD_WIDE Wide least_of(const Wide& a, const Wide& b) { return a < b ? a : b; }
SUBWORLD_WIDE Wide size_of(const Wide& a) { return most_of(a, -a); }
SUBWORLD_WIDE Wide root_of(Wide a) {
  for (std::size_t l = 0; l < kLanes; ++l) a[l] = btSqrt(a[l]);
  return a;
}

/// Velocities of both bodies of each pair, or their changes.
struct WideMotion {
  Wide3 linear_a, angular_a, linear_b, angular_b;
};

using Part = btScalar (Motion::*)[3];

template <std::size_t... kLane>
SUBWORLD_WIDE Wide load(const Motion* motions, const Lanes& of, Part part, int k, std::index_sequence<kLane...>) {
  return Wide{(motions[of[kLane]].*part)[k]...};
}
SUBWORLD_WIDE Wide3 load(const Motion* motions, const Lanes& of, Part part) {
  constexpr std::make_index_sequence<kLanes> kAll;
  return {load(motions, of, part, 0, kAll), load(motions, of, part, 1, kAll), load(motions, of, part, 2, kAll)};
}
SUBWORLD_WIDE WideMotion load(std::span<const Motion> motions, const Lanes& a, const Lanes& b) {
  const Motion* const all = motions.data();
  return {load(all, a, &Motion::linear), load(all, a, &Motion::angular), load(all, b, &Motion::linear),
          load(all, b, &Motion::angular)};
}
SUBWORLD_WIDE void store(const Wide3& linear, const Wide3& angular, const Lanes& of, Motion* motions) {
  for (std::size_t l = 0; l < kLanes; ++l) {
    if (of[l] == kFixed) continue;  // all threads read it
    Motion& motion = motions[of[l]];
    motion.linear[0] = linear.x[l], motion.linear[1] = linear.y[l], motion.linear[2] = linear.z[l];
    motion.angular[0] = angular.x[l], motion.angular[1] = angular.y[l], motion.angular[2] = angular.z[l];
  }
}
SUBWORLD_WIDE void store(const WideMotion& motion, const Lanes& a, const Lanes& b, std::span<Motion> motions) {
  store(motion.linear_a, motion.angular_a, a, motions.data());
  store(motion.linear_b, motion.angular_b, b, motions.data());
}

}  // namespace subworld::bullet
