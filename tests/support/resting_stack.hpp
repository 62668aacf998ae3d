#pragma once

#include "physics/shells/resting_engine.hpp"
#include "support/bodies.hpp"
#include "support/engines.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <span>

namespace subworld::test {

inline constexpr double kStep_s = 0.004, kHorizon_s = 0.016;

/// A floor, a stack of two cubes and a ball.
class RestingStack : public testing::TestWithParam<Tested> {
 protected:
  static constexpr BodyId kFloor{0}, kLower{1}, kUpper{2}, kBall{3};

  RestingStack() {
    add(floor_plane(kFloor), BodyState{});
    add(cube(kLower), at(0, 0, 0.05));
    add(cube(kUpper), at(0, 0, 0.15));
    Body ball = ball_proxy(kBall, 0.05, 0.5);
    ball.gravity = ball.rotates = true;
    add(ball, at(2, 0, 0.05));
  }
  void add(const Body& body, const BodyState& state) {
    scene.bodies.push_back(body);
    scene.initial.push_back(state);
  }
  RestingEngine& begin(bool rests = true, std::span<const BodyId> restless = {}) {
    inner = GetParam().make();
    engine = std::make_unique<RestingEngine>(*inner, scene, restless, rests, false);
    for (const Body& body : scene.bodies) engine->add(body, scene.initial[index(body.id)]);
    return *engine;
  }
  void run(double seconds) {
    for (double t = 0.0; t < seconds; t += kStep_s) {
      engine->follow(kStep_s, kHorizon_s);
      engine->step(kStep_s);
    }
  }

  Scene scene;
  std::unique_ptr<Engine> inner;
  std::unique_ptr<RestingEngine> engine;
};

}  // namespace subworld::test
