#pragma once

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

namespace subworld {

/// Sets of the numbers 0 .. count - 1 that are joined step by step (union-find with path halving).
class DisjointSets {
 public:
  /// Each number is a set of its own.
  void reset(std::size_t count) {
    parents_.resize(count);
    std::iota(parents_.begin(), parents_.end(), 0U);
  }
  /// Makes one number a set of its own. The other members of its set must be separated too.
  void separate(std::uint32_t i) noexcept { parents_[i] = i; }
  /// Equal for all members of a set.
  [[nodiscard]] std::uint32_t root(std::uint32_t i) noexcept {
    while (parents_[i] != i) i = parents_[i] = parents_[parents_[i]];
    return i;
  }
  /// Joins the sets of two roots; the first is the root of both.
  void join(std::uint32_t root, std::uint32_t other) noexcept { parents_[other] = root; }

 private:
  std::vector<std::uint32_t> parents_;
};

}  // namespace subworld
