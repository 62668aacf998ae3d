#pragma once

#include "physics/plugin.hpp"

namespace subworld::bullet {

inline constexpr SubstepCost kCost{
    .step_s = 4e-6, .body_s = 0.3e-6, .contact_s = 0.6e-6, .contact_iteration_s = 0.09e-6};
inline constexpr SubstepCost kLargeCost{
    .step_s = 4e-6, .body_s = 0.5e-6, .contact_s = 0.23e-6, .contact_iteration_s = 0.01e-6};
inline constexpr EnginePreset kPresets[] = {
    {.name = "fast",
     .what = "10 iterations, no sub-steps: what haptic steps need",
     .iterations = 10,
     .cost = kCost,
     .heavy_on_light = {700, 170}},
    {.name = "quality",
     .what = "sub-steps of at most 0.7 ms, 16 iterations in 8 small steps of each: for high stacks",
     .iterations = 16,
     .longest_substep_s = 0.7e-3,
     .cost = kCost,
     .heavy_on_light = {70000, 70000}},
    {.name = "large",
     .what = "small steps of 2 ms, contacts are searched for every 16 ms: for thousands of bodies that move",
     .iterations = 2,
     .longest_iteration_s = 1.05e-3,
     .cost = kLargeCost,
     .parallel_ratio = 0.5,
     .heavy_on_light = {700, 170}},
};
struct PresetValues {
  bool small_steps;                   ///< a sub-step is solved as small steps (small_steps.hpp)
  double contact_breaking_threshold;  ///< relative to the size of the smaller body
  /// Heaps of 3 g to 30 kg win 1.5 % of energy by impacts with 20 rigid passes, 3 % with 8 and 5 % with 1.
  int most_spring_passes = 0, most_rigid_passes = 0;
  double ahead_s = 0.0;  ///< contacts are found for this time; 0: for a sub-step
};
inline constexpr PresetValues kPresetValues[] = {
    {false, 0.005},
    {true, 0.002, 4, 20},
    {true, 0.002, 1, 2, 16.7e-3},
};

}  // namespace subworld::bullet
