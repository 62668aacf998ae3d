#include "lab/stability/cases/cases.hpp"

namespace subworld {

const std::vector<StabilityCase>& stability_cases() {
  static const std::vector<StabilityCase> kAll = [] {
    struct Group {
      const char* name;
      std::vector<StabilityCase> (*cases)();
    };
    std::vector<StabilityCase> all;
    for (const Group& group :
         {Group{"sliding", sliding_cases}, Group{"bouncing", bouncing_cases}, Group{"resting", resting_cases},
          Group{"rotation", rotation_cases}, Group{"structures", structure_cases}, Group{"extremes", extreme_cases},
          Group{"operator", operator_cases}, Group{"delay", delay_cases}}) {
      for (StabilityCase& one : group.cases()) {
        one.group = group.name;
        all.push_back(std::move(one));
      }
    }
    return all;
  }();
  return kAll;
}

}  // namespace subworld
