#pragma once

#include "model/body.hpp"

#include <vector>

namespace subworld::bench {

struct HeapWorld {
  std::vector<Body> bodies;
  std::vector<BodyState> states;
};

inline constexpr double kHeapCubeSide_m = 0.1;

/// Cubes poured into a bin that is about as wide as the heap is high; not settled.
[[nodiscard]] HeapWorld dense_heap(int cubes);

}  // namespace subworld::bench
