#include "coupling/messages/suppression.hpp"

#include <algorithm>

namespace subworld {

void SuppressedCycles::begin(const WorldFrame& frame) noexcept {
  if (!frame.suppression) return;
  from_ = frame.stamp;
  until_ = std::min(frame.suppression->until, frame.stamp + kMostSuppressedCycles);
  place_ = frame.suppression->place;
  ended_ = false;
}

void SuppressedCycles::end(std::uint64_t stamp) noexcept {
  if (stamp <= from_ + lead_ || stamp > until_) return;
  until_ = stamp;
  ended_ = true;
}

Box free_place(const Box& around, const Box& inner, std::span<const Box> obstacles) noexcept {
  Box place = around;
  for (const Box& obstacle : obstacles) {
    if (!place.meets(obstacle)) continue;
    // Cut where the way to the obstacle is longest.
    const Vec3 below = inner.lower - obstacle.upper, above = obstacle.lower - inner.upper;
    Eigen::Index low = 0, high = 0;
    const double way_below_m = below.maxCoeff(&low), way_above_m = above.maxCoeff(&high);
    if (way_below_m > way_above_m) {
      place.lower[low] = obstacle.upper[low];
    } else {
      place.upper[high] = obstacle.lower[high];
    }
  }
  return place;
}

}  // namespace subworld
