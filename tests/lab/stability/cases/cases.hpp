#pragma once

#include "lab/stability/cases/case.hpp"

#include <vector>

/// The tables of the stability lab, one for each group.
namespace subworld {

[[nodiscard]] std::vector<StabilityCase> sliding_cases();
[[nodiscard]] std::vector<StabilityCase> bouncing_cases();
[[nodiscard]] std::vector<StabilityCase> resting_cases();
[[nodiscard]] std::vector<StabilityCase> rotation_cases();
[[nodiscard]] std::vector<StabilityCase> structure_cases();
[[nodiscard]] std::vector<StabilityCase> extreme_cases();
[[nodiscard]] std::vector<StabilityCase> operator_cases();
[[nodiscard]] std::vector<StabilityCase> delay_cases();

/// All cases, in the order of the page.
[[nodiscard]] const std::vector<StabilityCase>& stability_cases();

}  // namespace subworld
