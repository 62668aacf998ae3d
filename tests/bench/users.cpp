// What users cost: a cycle of the world beside users who touch nothing that others touch, and a haptic step with
// another user's proxy in the sub-world. Runs take turns cycle by cycle, so that their ratios hold on a shared machine.

#include "io/options/command_line.hpp"
#include "io/options/options.hpp"
#include "lab/session/coupled_run.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

namespace {

using namespace subworld;

constexpr double kWarmUp_s = 0.6;  ///< until all users touch their cubes
constexpr double kMedian = 0.5, kTail = 0.99;

struct Plan {
  std::vector<std::string> worlds{"heap", "lift"};
  std::vector<int> users{1, 2, 4, 8, 16, 32};
  std::vector<std::string> scenes{"squeeze", "weight", "pull_apart"};
  int cycles = 250;
};

Scene load(const std::string& name) { return load_scene(std::string(SCENES_FOLDER) + "/" + name + ".yaml"); }

/// A settled scene of which no body sleeps. Its first user alone comes down by 0.2 m and waits.
Scene settled(const std::string& name) {
  Scene scene = load(name);
  keep_users(scene, 1);
  scene.users[0].device.path = {{.to_s = 0.4, .displacement = {0, 0, -0.2}}};
  scene.settings.set_ratio({4, 4});
  scene.settings.duration_s = 1e6;
  scene.settings.disable(disabled(Optimisation::rest));
  std::vector<BodyState> at_rest = scene.initial;
  {
    World world(scene);
    world.settle([](double) { return true; });
    for (const Body& body : scene.bodies) {
      if (!body.fixed()) at_rest[index(body.id)] = world.engine().state(body.id);
    }
  }
  scene.initial = at_rest;
  scene.settings.settle_s = 0.0;
  return scene;
}

BodyId add_body(Scene& scene, Body body, const std::string& name, const Vec3& position) {
  body.id = BodyId{static_cast<std::uint32_t>(scene.bodies.size())};
  body.name = name;
  BodyState state;
  state.position = position;
  scene.bodies.push_back(body);
  scene.initial.push_back(state);
  return body.id;
}

/// With `count` users more, each of whom pushes a cube of its own, 2 m from all others.
Scene beside(const Scene& world, int count) {
  constexpr double kApart_m = 2.0, kHalf_m = 0.05, kGap_m = 0.005, kSpeed_m_s = 0.02;
  Scene scene = world;
  const Body cube = *std::ranges::find_if(world.bodies, [](const Body& body) { return !body.fixed(); });
  const Body tool = world.body(world.users[0].proxy);
  for (int i = 0; i < count; ++i) {
    const Vec3 place(kApart_m * (2 + i % 8), kApart_m * (i / 8), kHalf_m);
    add_body(scene, cube, fmt::format("own/{}", i), place);
    UserSpec user = scene.users[0];
    user.name = fmt::format("pusher_{}", i);
    const double away_m = kHalf_m + tool.shape.radius + kGap_m;
    user.proxy = add_body(scene, tool, user.name + "/proxy", place - Vec3(away_m, 0, 0));
    constexpr double kLong_s = 50.0;
    user.device.path = {{.to_s = kLong_s, .displacement = {kLong_s * kSpeed_m_s, 0, 0}}};
    scene.users.push_back(user);
  }
  scene.settings.users = static_cast<int>(scene.users.size());
  return scene;
}

/// CPU times of one run, by cycle, s.
class Times {
 public:
  void add(double s) { times_.push_back(s); }
  [[nodiscard]] double quantile_s(double q) {
    const auto nth = times_.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(times_.size() - 1));
    std::ranges::nth_element(times_, nth);
    return *nth;
  }

 private:
  std::vector<double> times_;
};

struct Measured {
  std::unique_ptr<CoupledRun> run;
  Times world;   ///< a cycle
  Times haptic;  ///< a haptic step, mean over users and the steps of a cycle
};

/// Of runs that have warmed up, in turns.
void measure(std::vector<Measured>& all, int cycles) {
  for (const Measured& one : all) {
    while (one.run->world.facts().time_s < kWarmUp_s) one.run->cycle();
  }
  for (int i = 0; i < cycles; ++i) {
    for (auto& [run, world, haptic] : all) {
      run->cpu = {};
      run->cycle();
      world.add(run->cpu.world.mean_s());
      haptic.add(run->cpu.haptic.mean_s());
    }
  }
}

void print_worlds(const Plan& plan) {
  fmt::print(
      "world,unconnected_users,world_p50_us,world_p99_us,one_more_p50_us,one_more_p50_ratio,one_more_p99_ratio\n");
  for (const std::string& name : plan.worlds) {
    const Scene world = settled(name);
    std::vector<Measured> all;
    all.emplace_back(std::make_unique<CoupledRun>(world));
    for (const int users : plan.users) all.emplace_back(std::make_unique<CoupledRun>(beside(world, users)));
    measure(all, plan.cycles);
    const double p50_s = all[0].world.quantile_s(kMedian), p99_s = all[0].world.quantile_s(kTail);
    fmt::print("{},0,{:.1f},{:.1f},,,\n", name, 1e6 * p50_s, 1e6 * p99_s);
    for (std::size_t i = 0; i < plan.users.size(); ++i) {
      const double with_p50_s = all[i + 1].world.quantile_s(kMedian), with_p99_s = all[i + 1].world.quantile_s(kTail);
      const double more_p50_s = (with_p50_s - p50_s) / plan.users[i], more_p99_s = (with_p99_s - p99_s) / plan.users[i];
      fmt::print("{},{},{:.1f},{:.1f},{:.2f},{:.4f},{:.4f}\n", name, plan.users[i], 1e6 * with_p50_s, 1e6 * with_p99_s,
                 1e6 * more_p50_s, more_p50_s / p50_s, more_p99_s / p99_s);
    }
  }
}

/// The first users of a scene; every sub-world holds all of it, so that a peer is all that it may have more.
std::unique_ptr<CoupledRun> with_users(const std::string& name, int users) {
  constexpr double kAll_m = 10.0, kNoLimit = 1e3;
  Scene scene = load(name);
  keep_users(scene, users);
  for (UserSpec& user : scene.users) {
    user.box_half_m = kAll_m;
    user.budget_ratio = kNoLimit;
  }
  return std::make_unique<CoupledRun>(scene);
}

void print_peers(const Plan& plan) {
  fmt::print("scene,peers,members,haptic_p50_us,haptic_p99_us,p50_ratio,p99_ratio\n");
  for (const std::string& name : plan.scenes) {
    std::vector<Measured> all;
    for (const int users : {1, 2}) all.emplace_back(with_users(name, users));
    measure(all, plan.cycles);
    for (auto& [run, world, haptic] : all) {
      const double p50_s = haptic.quantile_s(kMedian), p99_s = haptic.quantile_s(kTail);
      fmt::print("{},{},{},{:.1f},{:.1f},{:.3f},{:.3f}\n", name, run->frame().peers.size(), run->frame().members.size(),
                 1e6 * p50_s, 1e6 * p99_s, p50_s / all[0].haptic.quantile_s(kMedian),
                 p99_s / all[0].haptic.quantile_s(kTail));
    }
  }
}

int main_of(int argc, char** argv) {
  CommandLine line("bench_users",
                   "Measures a cycle of worlds beside users who each push a cube of their own, far away; then a haptic "
                   "step of scenes with one and with two users. CPU times, us.");
  Plan plan;
  line.add("--worlds", &plan.worlds, "scenes beside which users act");
  line.add("--users", &plan.users, "users far away").range(1, 63);
  line.add("--scenes", &plan.scenes, "scenes of two users");
  line.add("--cycles", &plan.cycles, "cycles of the world").range(1, 1'000'000);
  if (const auto code = line.parse(argc, argv)) return *code;
  print_worlds(plan);
  print_peers(plan);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return subworld::guarded("bench_users", [&] { return main_of(argc, argv); });
}
