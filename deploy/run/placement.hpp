#pragma once

#include "model/scene.hpp"

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace subworld {

/// The cores of each program; none: any.
struct Placement {
  std::vector<int> world;   ///< world_sim
  std::vector<int> others;  ///< every other program

  [[nodiscard]] const std::vector<int>& of(std::string_view program) const noexcept {
    return program == "world_sim" ? world : others;
  }
};

/// A core of its own for the world, in real time. The world computes for milliseconds at a time, and loops with a
/// higher priority that share its core pre-empt it in each of their periods. Nothing is placed where the other cores
/// have less room than the users' programs need; their loops use half of their budgets on average.
[[nodiscard]] Placement place(const Scene& scene, std::span<const int> cores);

/// Largest budget of a user's haptic step in real time, as a part of it, where all programs share `cores` cores: half
/// of what device, middleware and the rest of the haptic step leave, divided among the users. The other half is left to
/// the world: loops with a higher priority pre-empt it.
[[nodiscard]] double budget_limit_ratio(const Scene& scene, std::size_t cores);

/// As a list for `--core`; empty where the program may run anywhere.
[[nodiscard]] std::string to_text(const std::vector<int>& cores);

}  // namespace subworld
