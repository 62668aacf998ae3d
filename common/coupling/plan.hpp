#pragma once

#include "model/scene/scene.hpp"
#include "model/settings/optimisation.hpp"

#include <cstddef>
#include <vector>

namespace subworld {

/// The plan: which optimisations are on for a scene, and the fact that decides. A new one is a row of
/// optimisation_items(), a row of the table in plan.cpp and a place that asks enabled().
[[nodiscard]] Decision decision(const Scene& scene, Optimisation optimisation, std::size_t user = 0);
[[nodiscard]] inline bool enabled(const Scene& scene, Optimisation optimisation, std::size_t user = 0) {
  return decision(scene, optimisation, user).enabled;
}

/// Every item, by user where users differ.
[[nodiscard]] std::vector<PlannedItem> plan_of(const Scene& scene);

}  // namespace subworld
