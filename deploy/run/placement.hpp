#pragma once

#include "model/scene/scene.hpp"
#include "rt/calibration.hpp"

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace subworld {

struct Options;

/// The cores of each program; none: any.
struct Placement {
  std::vector<int> world;   ///< world_sim
  std::vector<int> others;  ///< haptic_sim and device_sim

  /// Programs without a priority may run anywhere: beside loops that have one, they would fill a core, and the kernel
  /// then halts the loops for up to 50 ms of each second.
  [[nodiscard]] std::vector<int> of(std::string_view program) const {
    if (program == "world_sim") return world;
    return program == "haptic_sim" || program == "device_sim" ? others : std::vector<int>{};
  }
};

/// What keys cost a user's programs in a haptic step, by vendor: measured with `heap` and two users.
inline constexpr double kFastKeys_s = 100e-6, kCycloneKeys_s = 45e-6;

/// A core of its own for the world, in real time; several where its engine shares its steps. The world computes for
/// milliseconds at a time, and loops with a higher priority that share its core pre-empt it in each of their periods.
/// Nothing is placed where the other cores have less room than the users' programs need; their loops use half of their
/// budgets on average. `keys_s`: what keys cost a user's programs in a haptic step. A core that real-time threads fill
/// is taken from them for 50 ms in each second.
[[nodiscard]] Placement place(const Scene& scene, std::span<const int> cores, double keys_s = 0.0);

/// Largest budget of a user's haptic step in real time, as a part of it, where all programs share `cores` cores: half
/// of what device, middleware and the rest of the haptic step leave, divided among the users. The other half is left to
/// the world: loops with a higher priority pre-empt it.
[[nodiscard]] double budget_limit_ratio(const Scene& scene, std::size_t cores);

/// Lowers the users' budgets to what the cores have left, where they are the scene's.
void share_cores(Options& options, Scene& scene);

/// As many threads of the world's engine as it has cores of its own, where the scene names none.
void share_steps(Options& options, Scene& scene, const Placement& placement);

/// How late this machine wakes bare loops. Takes a tenth of the run, at most a second, before any program of the run
/// starts.
[[nodiscard]] Calibration measure_machine(const Settings& settings);

/// Whether the environment chooses the cores of a program.
[[nodiscard]] bool is_placed_by_hand(const std::string& program);

/// As a list for `--core`; empty where the program may run anywhere.
[[nodiscard]] std::string to_text(const std::vector<int>& cores);

}  // namespace subworld
