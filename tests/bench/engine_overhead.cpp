// Overhead of the Engine interface: a step of 65 cubes in a dense heap through make_engine("bullet"), with contacts
// collected, merged and sorted, against stepSimulation() of the same world. Blocks of both alternate in one run, each
// from the same settled states; CPU time of this thread.
#include "bench/dense_heap.hpp"
#include "bench/direct_bullet.hpp"
#include "io/options/command_line.hpp"
#include "io/options/options.hpp"
#include "io/results/json.hpp"
#include "lab/session/cpu_time.hpp"
#include "model/error.hpp"
#include "physics/engine.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <fstream>
#include <string>
#include <vector>

namespace {

using namespace subworld;

constexpr int kCubes = 65;
constexpr double kStep_s = 1e-3;
constexpr double kSettle_s = 3.0;
constexpr double kMost = 0.10;  ///< of Bullet's own time
constexpr int kWarmUp = 50;     ///< steps at the start of a block that are not counted

struct Block {
  double median_s = 0.0;
  double p99_s = 0.0;
};

template <typename Step>
Block timed(int steps, const Step& step) {
  for (int i = 0; i < kWarmUp; ++i) step();
  std::vector<double> times(static_cast<std::size_t>(steps));
  for (double& time : times) {
    const double begin = thread_cpu_s();
    step();
    time = thread_cpu_s() - begin;
  }
  std::ranges::sort(times);
  return {times[times.size() / 2], times[times.size() * 99 / 100]};
}

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

/// For one quantile of the blocks.
struct Ratio {
  double engine_s = 0.0;
  double direct_s = 0.0;
  double overhead = 0.0;  ///< median of each pair of blocks' ratio, less 1
};

Ratio compare(const std::vector<Block>& engine, const std::vector<Block>& direct, double Block::*quantile) {
  std::vector<double> ours, theirs, ratios;
  for (std::size_t i = 0; i < engine.size(); ++i) {
    ours.push_back(engine[i].*quantile);
    theirs.push_back(direct[i].*quantile);
    ratios.push_back(ours.back() / theirs.back());
  }
  return {median(ours), median(theirs), median(ratios) - 1.0};
}

bool print(const char* what, const Ratio& ratio) {
  const bool ok = ratio.overhead <= kMost;
  fmt::print("  {}: {:.1f} us through the interface, {:.1f} us without\n", what, 1e6 * ratio.engine_s,
             1e6 * ratio.direct_s);
  fmt::print("interface overhead {:.1f} % {} {:.0f} %: {}\n", 1e2 * ratio.overhead, ok ? "<=" : ">", 1e2 * kMost,
             ok ? "ok" : "missed");
  return ok;
}

void write_csv(const std::string& file, const std::string& header, const std::string& line) {
  if (file.empty()) {
    fmt::print("{}\n{}\n", header, line);
    return;
  }
  std::ofstream out(file, std::ios::app);
  if (out.tellp() == 0) out << header << "\n";
  if (!(out << line << "\n").flush()) {
    throw Error(ExitCode::failed, fmt::format("{} cannot be written; give another file with --out", file));
  }
}

int main_of(int argc, char** argv) {
  CommandLine line("bench_engine_overhead", "Measures the cost of the Engine interface on a step of 65 dense bodies.");
  std::string out;
  int blocks = 41, steps = 400;
  line.add("--out", &out, "CSV file that gets one more line").otherwise("it is printed");
  line.add("--blocks", &blocks, "blocks of each side").range(1, 1000);
  line.add("--steps", &steps, "steps of a block that are counted").range(100, 100000);
  if (const auto code = line.parse(argc, argv)) return *code;

  bench::HeapWorld world = bench::dense_heap(kCubes);
  const EngineSettings settings;  // Bullet in double precision, preset fast
  const auto filled = [&] {
    auto engine = make_engine(settings, {});
    for (std::size_t i = 0; i < world.bodies.size(); ++i) engine->add(world.bodies[i], world.states[i]);
    return engine;
  };
  const auto settling = filled();
  for (double t = 0.0; t < kSettle_s; t += kStep_s) settling->step(kStep_s);
  for (std::size_t i = 0; i < world.bodies.size(); ++i) world.states[i] = settling->state(world.bodies[i].id);
  // Both sides are filled again, so that they have the same contacts from the first step on.
  const auto engine = filled();
  bench::DirectBullet direct(settings.gravity, kStep_s);
  for (std::size_t i = 0; i < world.bodies.size(); ++i) direct.add(world.bodies[i], world.states[i]);

  std::vector<Block> through, without;
  std::size_t contacts = 0;
  const auto engine_block = [&] {
    for (std::size_t i = 0; i < world.bodies.size(); ++i) engine->set_state(world.bodies[i].id, world.states[i]);
    through.push_back(timed(steps, [&] { engine->step(kStep_s); }));
  };
  const auto direct_block = [&] {
    for (std::size_t i = 0; i < world.bodies.size(); ++i) direct.set_state(i, world.states[i]);
    without.push_back(timed(steps, [&] { direct.step(); }));
  };
  for (int block = 0; block < blocks; ++block) {
    if (block % 2 == 0) engine_block();
    direct_block();
    if (block % 2 != 0) engine_block();
    for (std::size_t i = 0; i < world.bodies.size(); ++i) {
      if (engine->state(world.bodies[i].id).position == direct.state(i).position) continue;
      throw Error(ExitCode::failed, fmt::format("body {} moves otherwise without the interface: the two sides do not "
                                                "do the same work; bring direct_bullet.cpp in step with bullet.cpp",
                                                i));
    }
    contacts = engine->contacts().size();
  }

  const Ratio middle = compare(through, without, &Block::median_s);
  const Ratio tail = compare(through, without, &Block::p99_s);
  fmt::print("{} cubes, {} contacts, {} blocks of {} steps of {:g} ms; equal places bit by bit\n", kCubes, contacts,
             blocks, steps, 1e3 * kStep_s);
  const bool median_ok = print("median step", middle);
  const bool tail_ok = print("p99 step", tail);
  write_csv(
      out,
      "machine,kernel,engine,preset,bodies,contacts,dt_s,blocks,steps,engine_p50_s,direct_p50_s,overhead_p50_ratio,"
      "engine_p99_s,direct_p99_s,overhead_p99_ratio",
      fmt::format("\"{}\",{},{},{},{},{},{:g},{},{},{:.4e},{:.4e},{:.4f},{:.4e},{:.4e},{:.4f}",
                  machine().value("cpu", ""), machine().value("kernel", ""), settings.name, settings.preset, kCubes,
                  contacts, kStep_s, blocks, steps, middle.engine_s, middle.direct_s, middle.overhead, tail.engine_s,
                  tail.direct_s, tail.overhead));
  return static_cast<int>(median_ok && tail_ok ? ExitCode::done : ExitCode::quality);
}

}  // namespace

int main(int argc, char** argv) {
  return guarded("bench_engine_overhead", [&] { return main_of(argc, argv); });
}
