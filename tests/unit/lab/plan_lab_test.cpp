#include "lab/plan/measure.hpp"

#include <gtest/gtest.h>

namespace subworld {
namespace {

Json row_of(double force_difference, double apart_m, double enabled_m) {
  return {{"force_difference_rms", force_difference},
          {"reference_error", 0.01},
          {"error_enabled_rms", 0.02},
          {"error_disabled_rms", 0.02},
          {"position_difference_max_m", apart_m},
          {"reference_position_error_m", 0.001},
          {"position_error_enabled_m", enabled_m},
          {"position_error_disabled_m", 0.01}};
}

// A crate slides down a slope, and nobody touches it: an optimisation that brakes it changes no felt force.
TEST(PlanLab, ABodyThatEndsElsewhereIsWorse) {
  for (const double force_difference : {0.0, 0.005, double{NAN}}) {
    EXPECT_FALSE(no_worse(row_of(force_difference, 2.58, 2.58))) << force_difference;
    EXPECT_TRUE(no_worse(row_of(force_difference, 0.0009, 0.02))) << "within the reference error";
    EXPECT_TRUE(no_worse(row_of(force_difference, 0.02, 0.0105))) << "no farther from the reference";
  }
  EXPECT_FALSE(no_worse({{"force_difference_rms", 0.05},
                         {"reference_error", 0.01},
                         {"error_enabled_rms", 0.05},
                         {"error_disabled_rms", 0.02},
                         {"position_difference_max_m", 0.0}}));
}

}  // namespace
}  // namespace subworld
