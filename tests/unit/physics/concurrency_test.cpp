// Compiled with the thread sanitizer, which ends the program at the first race: while a world steps, other threads read
// it and exchange its engine.
#include "physics/shells/engine_exchange.hpp"
#include "rt/newest.hpp"
#include "support/bodies.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

namespace subworld {
namespace {

constexpr std::uint32_t kCubes = 60;
constexpr double kStep_s = 0.001;
constexpr int kSteps = 3000;

struct View {
  std::uint64_t step = 0;
  std::vector<BodyState> states;
};

/// Cubes in a loose pile that falls on a floor.
void fill(LiveEngine& engine) {
  engine.add(test::floor_plane(BodyId{kCubes}), BodyState{});
  for (std::uint32_t i = 0; i < kCubes; ++i) {
    engine.add(test::cube(BodyId{i}), test::at(0.11 * (i % 4), 0.11 * (i / 4 % 4), 0.06 + 0.11 * (i / 16)));
  }
}

TEST(Concurrency, AWorldIsReadWholeWhileItStepsAndChangesItsEngine) {
  LiveEngine engine(make_engine({}, {}));
  fill(engine);
  Newest<View, 3> newest;
  std::atomic<bool> over = false;
  std::atomic<int> looks = 0;
  std::vector<std::thread> readers;
  for (int r = 0; r < 3; ++r) {
    readers.emplace_back([&] {
      std::uint64_t last = 0;
      while (!over) {
        newest.read([&](const View& view) {
          EXPECT_GE(view.step, last) << "time went back";
          last = view.step;
          // Every state of a view has the step of the view: none is from another step.
          for (const BodyState& state : view.states) EXPECT_EQ(state.angular_velocity.x(), double(view.step));
        });
        ++looks;
        std::this_thread::yield();
      }
    });
  }
  EngineExchange exchange(EngineExchange::Preparation::in_background, {});
  const char* const engines[] = {"bullet_float", "bullet"};
  int changes = 0, refused = 0;
  // Threads that prepare engines or read may get no core for long.
  const auto seen_enough = [&] { return changes > 2 && looks > 100; };
  for (std::uint64_t n = 1; n <= kSteps || (!seen_enough() && n <= 1000 * kSteps); ++n) {
    EngineSettings next;
    next.name = engines[changes % 2];
    exchange.begin(next, engine, kStep_s);
    changes += exchange.poll(engine);
    engine.step(kStep_s);
    refused += !newest.renew([&](View& view) {
      view.step = n;
      view.states.resize(kCubes);
      for (std::uint32_t i = 0; i < kCubes; ++i) {
        view.states[i] = engine.state(BodyId{i});
        view.states[i].angular_velocity.x() = double(n);
      }
    });
  }
  over = true;
  for (std::thread& reader : readers) reader.join();
  EXPECT_GT(looks, 100);
  EXPECT_GT(changes, 2);
  EXPECT_EQ(refused, 0) << "the writer had to wait for readers";
  EXPECT_LT(engine.state(BodyId{0}).position.z(), 0.2) << "it did not fall";
}

}  // namespace
}  // namespace subworld
