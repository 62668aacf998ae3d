#pragma once

#include "physics/engine.hpp"
#include "support/bodies.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

namespace subworld::test {

inline constexpr double kG = 9.81;

/// What an engine is held to; what it cannot do is said here and nowhere else.
struct EngineTraits {
  std::string_view name;
  double precision;  ///< relative, of what it stores: 1e-12 for double, 1e-6 for float
};
inline constexpr EngineTraits kEngines[] = {
    {"bullet", 1e-12},
    {"ode", 1e-12},
};

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
  [[nodiscard]] double precision() const {
    for (const EngineTraits& traits : kEngines) {
      if (traits.name == engine) return traits.precision;
    }
    throw std::logic_error("kEngines lacks " + engine);
  }
  [[nodiscard]] int steps(double seconds) const { return static_cast<int>(std::lround(seconds / dt)); }
  friend std::ostream& operator<<(std::ostream& out, const Tested& t) {
    return out << t.engine << " " << t.preset << " " << t.dt << " s";
  }
};

/// Every engine with its presets, each at these steps (s).
inline std::vector<Tested> tested_engines(std::initializer_list<double> fast, std::initializer_list<double> quality) {
  std::vector<Tested> all;
  for (const EngineTraits& engine : kEngines) {
    for (const double dt : fast) all.push_back({std::string(engine.name), "fast", dt});
    for (const double dt : quality) all.push_back({std::string(engine.name), "quality", dt});
  }
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
inline Totals totals(const Engine& engine, BodyId id) {
  Totals sum;
  for (const Contact& c : engine.contacts()) {
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
