#pragma once

#include "physics/engine.hpp"
#include "support/bodies.hpp"
#include "support/grid.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

namespace subworld::test {

inline constexpr double kG = 9.81;

/// One engine, preset and step of a test suite.
inline constexpr BodyId kFloor{0}, kBody{1}, kCube{1}, kOther{2};
inline constexpr double kCubeWeight_n = 0.2 * kG;

/// One engine, preset and step that a suite is run with.
struct Tested {
  std::string engine;
  std::string preset;
  double dt = 0.001;

  [[nodiscard]] EngineSettings settings() const {
    EngineSettings s;
    s.name = engine;
    s.preset = preset;
    return s;
  }
  [[nodiscard]] std::unique_ptr<Engine> make(std::span<const Mesh> meshes = {}) const {
    return make_engine(settings(), meshes);
  }
  /// Relative rounding error of numbers that pass through the engine.
  [[nodiscard]] double precision() const { return 16.0 * make()->capabilities().precision; }
  [[nodiscard]] int steps(double seconds) const { return static_cast<int>(std::lround(seconds / dt)); }
  friend std::ostream& operator<<(std::ostream& out, const Tested& t) {
    return out << t.engine << " " << t.preset << " " << t.dt << " s";
  }
};

/// Every engine with its presets, each at these steps (s).
inline std::vector<Tested> tested_engines(std::initializer_list<double> fast, std::initializer_list<double> quality) {
  std::vector<Tested> all;
  for (const std::string& engine : engine_names()) {
    for (const double dt : fast) all.push_back({engine, "fast", dt});
    for (const double dt : quality) all.push_back({engine, "quality", dt});
  }
  return all;
}

/// Those of the named engines.
inline std::vector<Tested> only(std::initializer_list<std::string_view> names, std::vector<Tested> all) {
  std::erase_if(all, [&](const Tested& one) { return std::ranges::find(names, one.engine) == names.end(); });
  return all;
}

inline std::string name_of(const testing::TestParamInfo<Tested>& info) {
  return info.param.engine + "_" + info.param.preset + "_" + std::to_string(std::lround(1e6 * info.param.dt)) + "us";
}

inline void run(Engine& engine, int steps, double dt) {
  for (int i = 0; i < steps; ++i) engine.step(dt);
}

struct Totals {
  double normal = 0.0;
  Vec3 tangential = Vec3::Zero();
};

/// Impulses of the last step on the body `id`, sizes of the normal ones.
inline Totals totals(Engine& engine, BodyId id) {
  Totals sum;
  for (const Contact& c : engine.contacts_with_friction()) {
    if (c.a != id && c.b != id) continue;
    sum.normal += c.normal_impulse;
    sum.tangential += (c.a == id ? 1.0 : -1.0) * c.tangential_impulse;
  }
  return sum;
}

/// All numbers of the bodies' states, one after the other.
inline std::vector<double> bits(const Engine& engine, const std::vector<BodyId>& ids) {
  std::vector<double> all;
  for (const BodyId id : ids) {
    const BodyState s = engine.state(id);
    for (int i = 0; i < 3; ++i) {
      all.insert(all.end(), {s.position[i], s.linear_velocity[i], s.angular_velocity[i]});
    }
    for (int i = 0; i < 4; ++i) all.push_back(s.orientation.coeffs()[i]);
  }
  return all;
}

}  // namespace subworld::test
