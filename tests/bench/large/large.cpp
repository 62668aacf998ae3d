// Large moving worlds: CPU time of a cycle of the world's engine, by kind of work, and the deepest penetration.

#include "bench/large/large_world.hpp"
#include "io/options/command_line.hpp"
#include "io/options/options.hpp"
#include "model/error.hpp"
#include "physics/engine.hpp"

#include <fmt/core.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <ctime>
#include <fstream>
#include <string>
#include <vector>

namespace subworld {
namespace {

struct Plan {
  std::vector<std::string> engines{"bullet", "bullet_float", "ode"}, worlds{"basin"};
  std::string preset = "quality";
  std::vector<int> bodies{500, 2000, 8000};
  int iterations = 0, parts = 4, threads = 1;
  double cycle_ms = 16.0, seconds = 3.0;
  std::string to;
};

/// Boxes, spheres and the ground, for engines of other programs (peers.mjs).
void write(const Scene& scene, const std::string& file) {
  nlohmann::json list = nlohmann::json::array();
  for (const Body& body : scene.bodies) {
    const BodyState& at = scene.initial[index(body.id)];
    const Vec3 &half = body.shape.half_extents, &x = at.position, &v = at.linear_velocity;
    const Quat& q = at.orientation;
    list.push_back({{"plane", body.shape.kind == ShapeKind::plane},
                    {"half", {half.x(), half.y(), half.z()}},
                    {"radius", body.shape.radius},
                    {"mass", body.mass},
                    {"position", {x.x(), x.y(), x.z()}},
                    {"orientation", {q.x(), q.y(), q.z(), q.w()}},
                    {"velocity", {v.x(), v.y(), v.z()}}});
  }
  std::ofstream(file) << list;
}

double cpu_s() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}
double wall_s() {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

struct Figures {
  double wall_s, cpu_s;
  EngineTimes times;
  std::size_t contacts;
  double deepest_m, kinetic_j;
  double leave_s;  ///< all that move leave at once, as when they fall asleep
};

Figures measure(const Plan& plan, const std::string& engine_name, const Scene& scene) {
  EngineSettings settings;
  settings.name = engine_name;
  settings.preset = plan.preset;
  if (plan.iterations > 0) settings.iterations = plan.iterations;
  settings.substeps = 1;
  settings.threads = plan.threads;
  const auto engine = make_engine(settings, scene.meshes);
  if (!scene.joints.empty()) engine->set_joints(scene.joints);
  for (const Body& body : scene.bodies) engine->add(body, scene.initial[index(body.id)]);
  Figures figures{};
  const auto cycles = static_cast<int>(1e3 * plan.seconds / plan.cycle_ms);
  engine->time_parts(&figures.times);
  const double began = wall_s(), cpu_began = cpu_s();
  for (int i = 0; i < cycles * plan.parts; ++i) engine->step(1e-3 * plan.cycle_ms / plan.parts);
  figures.wall_s = (wall_s() - began) / cycles;
  figures.cpu_s = (cpu_s() - cpu_began) / cycles;
  engine->time_parts(nullptr);
  for (double* part : {&figures.times.solving_s, &figures.times.exchange_s, &figures.times.totals_s}) *part /= cycles;
  figures.contacts = engine->contacts().size();
  for (const Contact& contact : engine->contacts()) figures.deepest_m = std::min(figures.deepest_m, contact.distance);
  for (const Body& body : scene.bodies) figures.kinetic_j += kinetic_energy(body, engine->state(body.id));
  std::vector<BodyId> all;
  for (const Body& body : scene.bodies) {
    if (!body.fixed()) all.push_back(body.id);
  }
  const double leave = wall_s();
  engine->remove_all(all);
  figures.leave_s = wall_s() - leave;
  return figures;
}

int main_of(int argc, char** argv) {
  CommandLine line("bench_large", "Measures the engines on large moving worlds.");
  Plan plan;
  line.add("--engine", &plan.engines, "engines");
  line.add("--world", &plan.worlds, fmt::format("{}", fmt::join(bench::kLargeWorlds, ", ")));
  line.add("--preset", &plan.preset, "preset of all");
  line.add("--bodies", &plan.bodies, "boxes that move").range(10, 100000);
  line.add("--iterations", &plan.iterations, "solver iterations of an engine's step; 0: the preset's").range(0, 1000);
  line.add("--substeps", &plan.parts, "steps of the engine in a cycle").range(1, 100);
  line.add("--threads", &plan.threads, "threads that share a step").range(1, 256);
  line.add("--cycle-ms", &plan.cycle_ms, "length of a cycle").range(0.1, 100.0, "ms");
  line.add("--seconds", &plan.seconds, "simulated time").range(0.1, 1000.0, "s");
  line.add("--write", &plan.to, "only writes the first world to this JSON file, for peers.mjs");
  if (const auto code = line.parse(argc, argv)) return *code;
  if (!plan.to.empty()) {
    write(bench::large_world(plan.worlds.front(), plan.bodies.front()), plan.to);
    return static_cast<int>(ExitCode::done);
  }
  fmt::print("means over cycles of {:g} ms in {} steps, {:g} s, preset {}\n", plan.cycle_ms, plan.parts, plan.seconds,
             plan.preset);
  fmt::print("{:>6} {:>13} {:>7} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>10} {:>9}\n", "world", "engine",
             "bodies", "wall ms", "CPU ms", "ns/body", "engine ms", "transfer", "totals", "contacts", "deepest",
             "kinetic J", "leave ms");
  for (const std::string& world : plan.worlds) {
    for (const int count : plan.bodies) {
      const Scene scene = bench::large_world(world, count);
      for (const std::string& engine : plan.engines) {
        const Figures f = measure(plan, engine, scene);
        fmt::print(
            "{:>6} {:>13} {:>7} {:>9.2f} {:>9.2f} {:>9.0f} {:>9.2f} {:>9.2f} {:>9.2f} {:>9} {:>9.5f} {:>10.3g} "
            "{:>9.1f}\n",
            world, engine, count, 1e3 * f.wall_s, 1e3 * f.cpu_s, 1e9 * f.wall_s / count, 1e3 * f.times.solving_s,
            1e3 * f.times.exchange_s, 1e3 * f.times.totals_s, f.contacts, f.deepest_m, f.kinetic_j, 1e3 * f.leave_s);
        std::fflush(stdout);
      }
    }
  }
  return static_cast<int>(ExitCode::done);
}

}  // namespace
}  // namespace subworld

int main(int argc, char** argv) {
  return subworld::guarded("bench_large", [&] { return subworld::main_of(argc, argv); });
}
