#include "wire/held_samples.hpp"

#include <gtest/gtest.h>

namespace subworld::wire {
namespace {

using std::chrono::milliseconds;

/// The samples of one reader, by the first byte after the header, as they may be taken now. Each is put with the time
/// of its arrival before now.
class Delayed : public ::testing::Test {
 protected:
  HeldSamples& open(const DelaySettings& delay, Direction direction, bool repeats = false, int depth = 2) {
    return held_.emplace(kTopicOf<SceneDescription>, Qos{.depth = depth},
                         Transit{Journey(delay, 0), direction, repeats});
  }
  void put(std::uint8_t number, milliseconds ago) {
    std::vector<std::uint8_t> bytes{0, 1, 0, 0, number};
    EXPECT_TRUE(held_->put(1, bytes, HeldSamples::Clock::now() - ago));
  }
  std::vector<int> taken() {
    std::vector<int> numbers;
    std::vector<std::uint8_t> bytes;
    std::uint64_t writer = 0;
    while (held_->take(bytes, writer)) numbers.push_back(bytes.back());
    return numbers;
  }
  using Numbers = std::vector<int>;

  std::optional<HeldSamples> held_;
};

TEST_F(Delayed, SamplesAreTakenWhenTheDelayOfTheirDirectionIsOver) {
  open({.down_s = 0.5, .from_device_s = 0.2}, Direction::down);
  put(1, milliseconds(550));
  put(2, milliseconds(300));
  EXPECT_EQ(taken(), Numbers{1});
  open({.down_s = 0.5, .from_device_s = 0.2}, Direction::from_device);
  put(1, milliseconds(300));
  put(2, milliseconds(150));
  EXPECT_EQ(taken(), Numbers{1});
  open({.down_s = 0.5, .from_device_s = 0.2}, Direction::from_peer);
  put(1, milliseconds(750));
  put(2, milliseconds(600));
  EXPECT_EQ(taken(), Numbers{1});
}

TEST_F(Delayed, ThoseUnderWayNeedNoPlaceInTheHistory) {
  open({.down_s = 0.5}, Direction::down);
  for (std::uint8_t i = 0; i < 10; ++i) put(i, milliseconds(400 - i));
  EXPECT_EQ(taken(), Numbers{});
  put(10, milliseconds(0));
  // All but the last have arrived 0.2 s later; then the reader has the newest two.
  open({.down_s = 0.5}, Direction::down);
  for (std::uint8_t i = 0; i < 10; ++i) put(i, milliseconds(800 - i));
  put(10, milliseconds(0));
  EXPECT_EQ(taken(), (Numbers{8, 9}));
}

TEST_F(Delayed, OneThatIsOvertakenIsDroppedWhereNoneIsRepeated) {
  const DelaySettings jitter{.jitter_s = 0.5};
  for (const bool repeats : {false, true}) {
    open(jitter, Direction::down, repeats);
    Numbers all;
    for (std::uint8_t i = 0; i < 100; ++i) put(i, milliseconds(1000));
    // The history holds those that are due: none is when it is put.
    for (const int number : taken()) {
      if (!all.empty()) EXPECT_GT(number, all.back());
      all.push_back(number);
    }
    if (repeats) EXPECT_EQ(all.size(), 100U);
    if (!repeats) EXPECT_LT(all.size(), 100U);
    EXPECT_FALSE(all.empty());
  }
}

TEST_F(Delayed, LostSamplesComeLaterOrNever) {
  const DelaySettings loss{.up_s = 0.1, .down_s = 0.1, .loss_ratio = 0.5};
  open(loss, Direction::down);
  for (std::uint8_t i = 0; i < 100; ++i) put(i, milliseconds(150));
  const std::size_t some = taken().size();
  EXPECT_GT(some, 30U);
  EXPECT_LT(some, 70U);
  open(loss, Direction::down, true);
  for (std::uint8_t i = 0; i < 100; ++i) put(i, milliseconds(150));
  const std::size_t repeated = taken().size();
  EXPECT_GT(repeated, 30U) << "the writer's history forgets them, and those behind them need not wait";
  EXPECT_LT(repeated, 70U);
  open(loss, Direction::down, true, 200);
  for (std::uint8_t i = 0; i < 100; ++i) put(i, milliseconds(150));
  EXPECT_LT(taken().size(), 20U) << "each waits for those before it";
  open(loss, Direction::down, true, 200);
  for (std::uint8_t i = 0; i < 100; ++i) put(i, milliseconds(1100));
  EXPECT_EQ(taken().size(), 100U) << "after four losses";
}

}  // namespace
}  // namespace subworld::wire
