// Wake-up lateness of a loop: asleep until its release, or polling the clock before it; free to migrate, or pinned to a
// core. The variants alternate in short blocks, so that other load on the machine affects all of them. Prints CSV with
// the machine, and each variant's p99 as a ratio to the first one's.

#include "io/options/command_line.hpp"
#include "io/options/options.hpp"
#include "io/results/json.hpp"
#include "rt/cyclic.hpp"
#include "rt/histogram.hpp"
#include "rt/scheduling.hpp"

#include <fmt/core.h>

#include <cstdint>
#include <thread>
#include <vector>

namespace {

using namespace subworld;

struct Variant {
  double spin_s = 0.0;
  int core = -1;  ///< -1: any
  Histogram lateness;
  std::uint64_t releases = 0;
  std::uint64_t over_half_period = 0;
};

/// A block of one variant, in its own thread, like a program's loop.
void measure(Variant& variant, double period_s, double block_s, int priority) {
  std::thread([&] {
    if (variant.core >= 0) keep_to_cores({&variant.core, 1});
    if (priority > 0) claim_realtime(priority);
    const auto releases = static_cast<int>(block_s / period_s);
    Cyclic loop(Clock::now() + from_seconds(period_s), from_seconds(period_s), from_seconds(variant.spin_s));
    for (int i = 0; i < releases; ++i) {
      const double late_s = to_seconds(loop.wait());
      variant.lateness.add(late_s);
      ++variant.releases;
      variant.over_half_period += late_s > 0.5 * period_s;
    }
  }).join();
}

int main_of(int argc, char** argv) {
  CommandLine line("bench_wake_up", "Measures how late a loop wakes, with and without a spin and a core of its own.");
  double period_s = 1e-3, block_s = 1.0;
  int blocks = 10, priority = subworld::priority::kHaptic;
  std::vector<double> spins_us{0.0, 50.0, 150.0};
  std::vector<int> cores{-1};
  line.add("--period", &period_s, "period of the loop").range(1e-5, 1.0, "s");
  line.add("--block", &block_s, "length of a block of one variant").range(1e-3, 1e4, "s");
  line.add("--blocks", &blocks, "blocks of each variant").range(1, 1'000'000);
  line.add("--spin", &spins_us, "variants: spin before the release").range(0.0, 1e6, "us");
  line.add("--core", &cores, "variants: core to stay on; -1: any").range(-1, 1023);
  line.add("--priority", &priority, "SCHED_FIFO priority; 0: default scheduling").range(0, 99);
  if (const auto code = line.parse(argc, argv)) return *code;

  std::vector<Variant> variants;
  for (const int core : cores) {
    for (const double spin_us : spins_us) variants.push_back({.spin_s = 1e-6 * spin_us, .core = core, .lateness = {}});
  }
  for (int block = 0; block < blocks; ++block) {
    for (Variant& variant : variants) measure(variant, period_s, block_s, priority);
  }
  const Json machine = subworld::machine();
  fmt::print("# {}, {} cores, {}\n", machine["cpu"].get<std::string>(), machine["cores"].get<int>(),
             machine["kernel"].get<std::string>());
  fmt::print("spin_us,core,releases,p50_us,p99_us,p99_9_us,max_us,over_half_period,p99_ratio\n");
  for (const Variant& v : variants) {
    const auto us = [&](double q) { return 1e6 * v.lateness.quantile_s(q); };
    fmt::print("{:g},{},{},{:.2f},{:.2f},{:.2f},{:.2f},{},{:.3f}\n", 1e6 * v.spin_s, v.core, v.releases, us(0.5),
               us(0.99), us(0.999), 1e6 * v.lateness.max_s(), v.over_half_period,
               v.lateness.quantile_s(0.99) / variants.front().lateness.quantile_s(0.99));
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return subworld::guarded("bench_wake_up", [&] { return main_of(argc, argv); });
}
