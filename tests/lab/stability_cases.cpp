#include "lab/stability_cases.hpp"

namespace subworld {

const std::vector<StabilityCase>& stability_cases() {
  static const std::vector<StabilityCase> kAll = [] {
    std::vector<StabilityCase> all;
    for (const auto& group :
         {sliding_cases, bouncing_cases, resting_cases, rotation_cases, structure_cases, extreme_cases}) {
      for (StabilityCase& one : group()) all.push_back(std::move(one));
    }
    return all;
  }();
  return kAll;
}

}  // namespace subworld
