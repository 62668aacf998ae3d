// Distribution of the time of an engine's step on dense heaps: the engine itself, the transfer of states, loads and
// contacts, adding up contacts, and the friction estimate.

#include "bench/dense_heap.hpp"
#include "io/options/command_line.hpp"
#include "io/options/options.hpp"
#include "model/error.hpp"
#include "physics/engine.hpp"

#include <fmt/core.h>

#include <string>
#include <vector>

namespace subworld {
namespace {

constexpr double kSettle_s = 3.0, kSettleStep_s = 4e-3;

struct Plan {
  std::vector<std::string> engines;
  std::string preset = "fast";
  std::vector<int> cubes{100, 200};
  double step_ms = 1.0;
  int steps = 500, warm_up = 100;
};

void fill(Engine& engine, const bench::HeapWorld& heap) {
  for (std::size_t i = 0; i < heap.bodies.size(); ++i) engine.add(heap.bodies[i], heap.states[i]);
}

/// At rest, as simulated by Bullet.
bench::HeapWorld settled(int cubes) {
  bench::HeapWorld heap = bench::dense_heap(cubes);
  const auto engine = make_engine({}, {});
  fill(*engine, heap);
  for (double t = 0.0; t < kSettle_s; t += kSettleStep_s) engine->step(kSettleStep_s);
  for (std::size_t i = 0; i < heap.bodies.size(); ++i) heap.states[i] = engine->state(heap.bodies[i].id);
  return heap;
}

void measure(const Plan& plan, const std::string& name, int cubes, const bench::HeapWorld& heap) {
  EngineSettings settings;
  settings.name = name;
  settings.preset = plan.preset;
  const auto engine = make_engine(settings, {});
  fill(*engine, heap);
  EngineTimes times;
  for (int i = -plan.warm_up; i < plan.steps; ++i) {
    if (i == 0) engine->time_parts(&times);
    engine->step(1e-3 * plan.step_ms);
    static_cast<void>(engine->contacts_with_friction());
  }
  engine->time_parts(nullptr);
  const double us = 1e6 / plan.steps;
  fmt::print("{:>13} {:>6} {:>9} {:>9.1f} {:>9.1f} {:>9.1f} {:>9.1f} {:>10.1f} %\n", name, cubes,
             engine->contacts().size(), us * times.solving_s, us * times.exchange_s, us * times.totals_s,
             us * times.friction_s, 100.0 * (times.exchange_s + times.totals_s) / times.solving_s);
  std::fflush(stdout);
}

int main_of(int argc, char** argv) {
  CommandLine line("bench_step_parts", "Divides the CPU time of a step of each engine, on dense heaps at rest.");
  Plan plan;
  line.add("--engine", &plan.engines, "engines").otherwise("all that are installed");
  line.add("--preset", &plan.preset, "preset of all");
  line.add("--cubes", &plan.cubes, "cubes of the heaps").range(1, 10000);
  line.add("--step-ms", &plan.step_ms, "length of a step").range(0.01, 100.0, "ms");
  line.add("--steps", &plan.steps, "steps that are counted").range(1, 100000);
  if (const auto code = line.parse(argc, argv)) return *code;
  if (plan.engines.empty()) plan.engines = engine_names();
  fmt::print("us of CPU a step of {:g} ms, preset {}; interface: exchange and totals, of the engine's own time\n",
             plan.step_ms, plan.preset);
  fmt::print("{:>13} {:>6} {:>9} {:>9} {:>9} {:>9} {:>9} {:>12}\n", "engine", "cubes", "contacts", "engine", "exchange",
             "totals", "friction", "interface");
  for (const int cubes : plan.cubes) {
    const bench::HeapWorld heap = settled(cubes);
    for (const std::string& name : plan.engines) measure(plan, name, cubes, heap);
  }
  return static_cast<int>(ExitCode::done);
}

}  // namespace
}  // namespace subworld

int main(int argc, char** argv) {
  return subworld::guarded("bench_step_parts", [&] { return subworld::main_of(argc, argv); });
}
