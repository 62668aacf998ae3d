// Bounces of single bodies against Newton's law of restitution.

#include "model/shapes/mass_properties.hpp"
#include "support/engines.hpp"

#include <fmt/core.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

namespace subworld {
namespace {

using test::at;
using test::kBody;
using test::kFloor;
using test::kG;
using test::Tested;

class Bounces : public testing::TestWithParam<Tested> {
 protected:
  /// A body at this height above a floor; its centre is `reach_m` above its lowest point.
  void drop(const Shape& shape, double reach_m, double restitution, double height_m) {
    engine_ = GetParam().make();
    Body floor = test::floor_plane(kFloor);
    floor.material.restitution = 1.0;
    engine_->add(floor, BodyState{});
    Body body;
    body.id = kBody;
    body.shape = shape;
    body.mass = 1.0;
    body.inertia = principal_inertia(shape, body.mass);
    body.rotates = false;  // a cube that lands flat soon tumbles
    body.material = {.friction = 0.0, .restitution = restitution};
    engine_->add(body, at(0, 0, reach_m + height_m));
    reach_m_ = reach_m;
  }
  [[nodiscard]] double h_s() const { return engine_->integration_substep_s(GetParam().dt); }

  /// Height of the next flight, 0 if there is none. Engines advance v by g h, then z by v h. Such points lie on a
  /// parabola with the speed v - g h / 2, so each of them gives its height: z + (v - g h / 2)^2 / (2 g).
  [[nodiscard]] double next_height_m() {
    bool rises = false;
    for (int i = 0; i < GetParam().steps(1.5); ++i) {
      engine_->step(GetParam().dt);
      const BodyState now = engine_->state(kBody);
      const bool rose = rises;
      rises = now.linear_velocity.z() > 0.0;
      if (!rose || rises) continue;
      const double speed_m_s = now.linear_velocity.z() - 0.5 * kG * h_s();
      return now.position.z() - reach_m_ + speed_m_s * speed_m_s / (2.0 * kG);
    }
    return 0.0;
  }

 private:
  std::unique_ptr<Engine> engine_;
  double reach_m_ = 0.0;
};

/// v' = e v (Newton, Principia, Scholium to the Laws): each flight has e^2 of the height of the last one.
TEST_P(Bounces, AsHighAsNewtonSays) {
  constexpr int kFlights = 20;
  constexpr double kLeastSpeed_m_s = 0.2;  // slower bodies do not bounce
  struct Case {
    const char* name;
    Shape shape;
    double reach_m;
  };
  const Case cases[] = {{"ball", {.kind = ShapeKind::sphere, .radius = 0.1}, 0.1},
                        {"marble", {.kind = ShapeKind::sphere, .radius = 0.01}, 0.01},
                        {"cube", {.kind = ShapeKind::box, .half_extents = {0.1, 0.1, 0.1}}, 0.1},
                        {"can", {.kind = ShapeKind::cylinder, .radius = 0.1, .half_length = 0.1}, 0.1}};
  // Each height gives another time of contact within a step.
  for (const auto& [name, shape, reach_m] : cases) {
    for (const double restitution : {1.0, 0.9, 0.5, 0.2}) {
      for (const double drop_m : {1.0, 0.83, 0.37}) {
        SCOPED_TRACE(fmt::format("{}, restitution {}, from {} m", name, restitution, drop_m));
        drop(shape, reach_m, restitution, drop_m);
        // A flight of a few steps cannot be lower than the gap in the step of its bounce.
        const double lowest_m = 2.0 * kG * std::pow(h_s() / restitution, 2.0);
        double last_m = drop_m + kG * h_s() * h_s() / 8.0;
        for (int n = 1; n <= kFlights; ++n) {
          const double expected_m = restitution * restitution * last_m;
          if (expected_m < lowest_m || std::sqrt(2.0 * kG * last_m) < kLeastSpeed_m_s + kG * h_s()) break;
          last_m = next_height_m();
          ASSERT_NEAR(last_m, expected_m, 1e-3 * expected_m) << "flight " << n;
        }
      }
    }
  }
}

std::vector<Tested> all_steps() {
  std::vector<Tested> all;
  for (const char* engine : {"bullet", "bullet_float"})
    for (const double dt : {0.0005, 0.001, 0.002, 0.004, 0.008}) all.push_back({engine, "fast", dt});
  // With `quality` a step of 4 ms has sub-steps of 0.67 ms.
  for (const double dt : {0.001, 0.004}) all.push_back({"bullet", "quality", dt});
  return all;
}
INSTANTIATE_TEST_SUITE_P(Bullets, Bounces, testing::ValuesIn(all_steps()), test::name_of);

}  // namespace
}  // namespace subworld
