// Cost of the stages of a loop: a mark, and a step of ten marks, beside one reading of the clock, in one run.

#include "rt/stages.hpp"

#include <fmt/core.h>

#include <cstdint>

namespace {

using namespace subworld;

enum class Stage : std::uint8_t { wake, a, b, c, d, e, f, g, h, i, count };

template <class Body>
double nanoseconds_of(int times, Body body) {
  const TimePoint begin = Clock::now();
  for (int i = 0; i < times; ++i) body();
  return 1e9 * to_seconds(Clock::now() - begin) / times;
}

}  // namespace

int main() {
  constexpr int kTimes = 200'000;
  Stages<Stage> stages;
  TimePoint sink;
  const double clock_ns = nanoseconds_of(kTimes, [&] { sink = Clock::now(); });
  const double step_ns = nanoseconds_of(kTimes / 10, [&] {
    stages.begin(sink, Clock::now());
    for (std::size_t s = 1; s < Stages<Stage>::kCount; ++s) stages.mark(static_cast<Stage>(s));
    stages.end();
  });
  fmt::print("clock_ns,mark_ns,step_of_10_ns,share_of_1ms\n{:.1f},{:.1f},{:.1f},{:.6f}\n", clock_ns, step_ns / 10.0,
             step_ns, 1e-6 * step_ns);
}
