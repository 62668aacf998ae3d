// The step of one engine against that of another, or of an earlier build of the same, on dense heaps of cubes that a
// sphere pushes. Blocks of both alternate in one run, each from the same settled states; CPU time of this thread.
// An earlier build: copy its libsubworld_engine_bullet.so to before/libsubworld_engine_before.so, then
//   SUBWORLD_ENGINES=before bench_step_ratio bullet before
#include "bench/dense_heap.hpp"
#include "io/options/command_line.hpp"
#include "io/options/options.hpp"
#include "lab/session/cpu_time.hpp"
#include "model/error.hpp"
#include "model/shapes/mass_properties.hpp"
#include "physics/engine.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

namespace {

using namespace subworld;

constexpr double kSettle_s = 3.0, kSettleStep_s = 4e-3;
constexpr double kRadius_m = 0.05, kSphereMass_kg = 0.1;
constexpr double kPush_n = 10.0;

struct Plan {
  std::string engine, other;
  std::string preset = "fast";
  std::vector<int> cubes{100, 200, 250};
  std::vector<double> steps_ms{1.0, 4.0};
  int blocks = 21, steps = 200, warm_up = 50;
};

/// A settled heap with a sphere above it, the last body.
struct Pushed {
  bench::HeapWorld world;

  [[nodiscard]] BodyId sphere() const { return world.bodies.back().id; }
};

EngineSettings settings_for(const std::string& engine, const std::string& preset) {
  EngineSettings settings;
  settings.name = engine;
  settings.preset = preset;
  return settings;
}

class Side {
 public:
  Side(const std::string& engine, const std::string& preset, const Pushed& heap)
      : heap_(heap), engine_(make_engine(settings_for(engine, preset), {})) {
    for (std::size_t i = 0; i < heap.world.bodies.size(); ++i) {
      engine_->add(heap.world.bodies[i], heap.world.states[i]);
    }
  }

  /// Median CPU time of a step, s.
  double block(const Plan& plan, double dt) {
    for (std::size_t i = 0; i < heap_.world.bodies.size(); ++i) {
      engine_->set_state(heap_.world.bodies[i].id, heap_.world.states[i]);
    }
    std::vector<double> times;
    for (int i = -plan.warm_up; i < plan.steps; ++i) {
      engine_->apply_force(heap_.sphere(), Vec3(0, 0, -kPush_n), Vec3::Zero());
      const double begin = thread_cpu_s();
      engine_->step(dt);
      if (i >= 0) times.push_back(thread_cpu_s() - begin);
    }
    std::ranges::sort(times);
    return times[times.size() / 2];
  }

  [[nodiscard]] std::size_t contacts() const { return engine_->contacts().size(); }

  /// The largest distance (m) of a body from its place on the other side; 0 only if all bits are equal.
  [[nodiscard]] double apart(const Side& other) const {
    double most = 0.0;
    for (const Body& body : heap_.world.bodies) {
      most = std::max(most, (engine_->state(body.id).position - other.engine_->state(body.id).position).norm());
    }
    return most;
  }

 private:
  const Pushed& heap_;
  std::unique_ptr<Engine> engine_;
};

Pushed settled(const Plan& plan, int cubes) {
  Pushed heap{bench::dense_heap(cubes)};
  auto& [bodies, states] = heap.world;
  auto engine = make_engine(settings_for(plan.engine, plan.preset), {});
  for (std::size_t i = 0; i < bodies.size(); ++i) engine->add(bodies[i], states[i]);
  for (double t = 0.0; t < kSettle_s; t += kSettleStep_s) engine->step(kSettleStep_s);
  double top = 0.0;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    states[i] = engine->state(bodies[i].id);
    if (!bodies[i].fixed()) top = std::max(top, states[i].position.z());
  }
  Body sphere;
  sphere.id = BodyId{static_cast<std::uint32_t>(bodies.size())};
  sphere.shape.kind = ShapeKind::sphere;
  sphere.shape.radius = kRadius_m;
  sphere.mass = kSphereMass_kg;
  sphere.inertia = principal_inertia(sphere.shape, kSphereMass_kg);
  bodies.push_back(sphere);
  states.emplace_back().position = Vec3(0, 0, top + bench::kHeapCubeSide_m + kRadius_m);
  return heap;
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

void compare(const Plan& plan, int cubes, double dt) {
  const Pushed heap = settled(plan, cubes);
  Side ours(plan.engine, plan.preset, heap), theirs(plan.other, plan.preset, heap);
  std::vector<double> our_times, their_times, ratios;
  for (int block = 0; block < plan.blocks; ++block) {
    if (block % 2 == 0) our_times.push_back(ours.block(plan, dt));
    their_times.push_back(theirs.block(plan, dt));
    if (block % 2 != 0) our_times.push_back(ours.block(plan, dt));
    ratios.push_back(our_times.back() / their_times.back());
  }
  const double apart = ours.apart(theirs);
  fmt::print("{} cubes, {} contacts, step {:g} ms: {:.1f} us of {}, {:.1f} us of {}, ratio {:.3f}; {}\n", cubes,
             ours.contacts(), 1e3 * dt, 1e6 * median(our_times), plan.engine, 1e6 * median(their_times), plan.other,
             median(ratios), apart == 0.0 ? "equal places bit by bit" : fmt::format("places {:.2g} m apart", apart));
  std::fflush(stdout);
}

int main_of(int argc, char** argv) {
  CommandLine line("bench_step_ratio", "Compares the median step of two engines, or builds of one, on dense heaps.");
  Plan plan;
  line.add("engine", &plan.engine, "name of an engine").required();
  line.add("other", &plan.other, "name of the engine that it is divided by").required();
  line.add("--preset", &plan.preset, "preset of both");
  line.add("--cubes", &plan.cubes, "cubes of the heaps").range(1, 10000);
  line.add("--step-ms", &plan.steps_ms, "lengths of a step").range(0.01, 100.0, "ms");
  line.add("--blocks", &plan.blocks, "blocks of each side").range(1, 1000);
  line.add("--steps", &plan.steps, "steps of a block that are counted").range(1, 100000);
  line.add("--warm-up", &plan.warm_up, "steps of a block that are not counted").range(0, 100000);
  if (const auto code = line.parse(argc, argv)) return *code;
  for (const int cubes : plan.cubes) {
    for (const double step_ms : plan.steps_ms) compare(plan, cubes, 1e-3 * step_ms);
  }
  return static_cast<int>(ExitCode::done);
}

}  // namespace

int main(int argc, char** argv) {
  return guarded("bench_step_ratio", [&] { return main_of(argc, argv); });
}
