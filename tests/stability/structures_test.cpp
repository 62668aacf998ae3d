// The structures that stand in each engine with its preset `quality`, at the step of a picture (paper 3.2).

#include "lab/session/cpu_time.hpp"
#include "model/scene/scene.hpp"
#include "physics/engine.hpp"
#include "support/grid.hpp"

#include <fmt/core.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <ostream>
#include <string>
#include <vector>

namespace subworld {
namespace {

constexpr double kDt_s = 1.0 / 60.0;
constexpr double kDuration_s = 60.0;

struct Structure {
  const char* scene;
  std::vector<std::string> held_by;  ///< for the other engines the result is only printed
};
const Structure kStructures[] = {
    {"stack", {"bullet", "bullet_float", "havok", "physx", "rapier"}},
    {"card_house", {"bullet", "bullet_float", "physx", "rapier"}},
};

/// Largest displacement of the top of the stack.
constexpr double kTopLimit_m = 0.15;
/// Largest displacement of the centre of any other body, relative to its longest side.
constexpr double kCentreLimitRatio = 0.5;

struct Case {
  const Structure* structure;
  std::string engine;

  [[nodiscard]] bool must_hold() const {
    return std::ranges::find(structure->held_by, engine) != structure->held_by.end();
  }
  friend std::ostream& operator<<(std::ostream& out, const Case& c) {
    return out << c.structure->scene << " " << c.engine;
  }
};

test::Halves<Case> cases() {
  std::vector<Case> all;
  for (const Structure& structure : kStructures) {
    for (const std::string& engine : engine_names()) all.push_back({&structure, engine});
  }
  return test::halves(all, engine_names().size());
}

/// The bodies that decide whether the structure stands, with the largest displacement (m) of each.
struct Watched {
  BodyId id;
  Vec3 start;
  double limit_m;
};
std::vector<Watched> watched(const Scene& scene) {
  std::vector<Watched> all;
  for (const Body& body : scene.bodies) {
    if (body.fixed()) continue;
    const double longest_m = 2.0 * body.shape.half_extents.maxCoeff();
    all.push_back({body.id, scene.initial[index(body.id)].position, kCentreLimitRatio * longest_m});
  }
  if (scene.name != "stack") return all;
  Watched top = *std::ranges::max_element(all, {}, [](const Watched& w) { return w.start.z(); });
  top.limit_m = kTopLimit_m;
  return {top};
}

class Structures : public testing::TestWithParam<Case> {};

TEST_P(Structures, StandForAMinute) {
  Scene scene = load_scene(fmt::format("{}/{}.yaml", SCENES_FOLDER, GetParam().structure->scene));
  keep_users(scene, 0);
  EngineSettings settings;
  settings.name = GetParam().engine;
  settings.preset = "quality";
  settings.gravity = scene.settings.world.gravity;
  const auto engine = make_engine(settings, scene.meshes);
  for (const Body& body : scene.bodies) engine->add(body, scene.initial[index(body.id)]);

  const std::vector<Watched> bodies = watched(scene);
  const int steps = static_cast<int>(std::lround(kDuration_s / kDt_s));
  bool stands = true;
  int step = 0;
  double moved_m = 0.0, cpu_s = 0.0, cpu_max_s = 0.0;
  while (stands && step < steps) {
    const double begin_s = thread_cpu_s();
    engine->step(kDt_s);
    const double step_cpu_s = thread_cpu_s() - begin_s;
    ++step;
    cpu_s += step_cpu_s;
    cpu_max_s = std::max(cpu_max_s, step_cpu_s);
    for (const Watched& one : bodies) {
      const double distance_m = (engine->state(one.id).position - one.start).norm();
      moved_m = std::max(moved_m, distance_m);
      stands = stands && distance_m <= one.limit_m;  // also if it is not a number
    }
  }
  fmt::print("{} {}: {} {:.1f} s, moved by {:.1f} mm, CPU of a step of 1/60 s: mean {:.2f} ms, max {:.2f} ms\n",
             GetParam().structure->scene, GetParam().engine, stands ? "stood" : "fell after", step * kDt_s,
             1e3 * moved_m, 1e3 * cpu_s / step, 1e3 * cpu_max_s);
  if (GetParam().must_hold()) {
    EXPECT_TRUE(stands) << "fell after " << step * kDt_s << " s";
  }
}

std::string name_of(const testing::TestParamInfo<Case>& tested) {
  return fmt::format("{}_{}", tested.param.structure->scene, tested.param.engine);
}
INSTANTIATE_TEST_SUITE_P(Engines, Structures, testing::ValuesIn(cases().half), name_of);
INSTANTIATE_TEST_SUITE_P(Full, Structures, testing::ValuesIn(cases().other), name_of);

}  // namespace
}  // namespace subworld
