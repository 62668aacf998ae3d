// Frames and reports that carry changes only (wire/changes).
#include "support/wire_samples.hpp"
#include "wire/codec/changes.hpp"
#include "wire/codec/codec.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <optional>
#include <random>

namespace subworld {
namespace {

using test::numbers_of;
using test::SampleMaker;
using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kBodies = 20;

template <class M>
Bytes encoded(Codec<M>& codec, const M& sample) {
  const auto bytes = codec.encode(sample);
  return {bytes.begin(), bytes.end()};
}

template <class M>
bool same(const M& a, const M& b) {
  const std::vector<double> x = numbers_of(a), y = numbers_of(b);
  return std::ranges::equal(
      x, y, [](double p, double q) { return std::bit_cast<std::uint64_t>(p) == std::bit_cast<std::uint64_t>(q); });
}

/// Bodies and ghosts of a world in which only some move, and which come and go. Ids ascend.
class Neighbourhood {
 public:
  explicit Neighbourhood(std::uint32_t seed) : make_(seed), random_(seed) {
    frame_ = make_.make<WorldFrame>();
    report_ = make_.make<HapticReport>();
    frame_.stamp = report_.stamp = 100;
    report_.omits_overruled = false;
    frame_.states.resize(kBodies);
    frame_.ghosts.resize(kBodies);
    report_.members.resize(kBodies);
    for (std::size_t i = 0; i < kBodies; ++i) renew(i);
  }
  /// A cycle later, some have moved. `base`: what the receiver has confirmed.
  void step(std::optional<std::uint64_t> frame_base, std::optional<std::uint64_t> report_base) {
    ++frame_.stamp;
    ++report_.stamp;
    frame_.base_stamp = frame_base;
    report_.base_stamp = report_base;
    for (int i = 0; i < 3; ++i) move(random_() % frame_.states.size());
    if (random_() % 4 == 0) renew(random_() % kBodies);
    if (random_() % 4 == 0) make_.fill_all(frame_.members);
    if (random_() % 4 == 0) make_.fill_all(report_.islands);
  }
  WorldFrame frame_;
  HapticReport report_;

 private:
  /// With a friction that depends on the load: without, the load is not sent.
  void fill(GhostModel& ghost) {
    make_.fill(ghost);
    ghost.axis_count = std::max<std::size_t>(1, ghost.axis_count);
    ghost.axes[0].load_dependent_friction = make_.vector();
  }
  void move(std::size_t i) {
    BodyState& state = frame_.states[i].state;
    switch (random_() % 4) {
      case 0:
        state.position.x() = std::nextafter(state.position.x(), 1.0);
        break;
      case 1:
        state.linear_velocity = Vec3{-0.0, 0.0, 0.0};
        break;
      case 2:
        state.orientation = make_.quaternion();
        break;
      default:
        state.angular_velocity = make_.vector();
    }
    report_.members[i].state = state;
    fill(frame_.ghosts[i]);
    name(i);
  }
  void renew(std::size_t i) {
    make_.fill(frame_.states[i]);
    make_.fill(report_.members[i]);
    fill(frame_.ghosts[i]);
    name(i, 1000 * i + random_() % 3);
  }
  void name(std::size_t i, std::optional<std::size_t> number = {}) {
    const BodyId id = number ? BodyId{static_cast<std::uint32_t>(*number)} : frame_.states[i].id;
    frame_.states[i].id = report_.members[i].id = frame_.ghosts[i].outside = id;
  }

  SampleMaker make_;
  std::mt19937 random_;
};

/// One direction of a link that loses messages, and the reader's confirmations of those that came.
template <class M>
struct Link {
  Codec<M> writer, reader;
  M received;
  std::optional<std::uint64_t> confirmed;

  /// False if it came and is not what was sent.
  bool send(const M& sample, bool lost, bool confirms) {
    const Bytes bytes = encoded(writer, sample);
    if (lost) return true;
    if (!reader.decode(bytes, received)) return false;
    if (confirms) confirmed = sample.stamp;
    return same(sample, received);
  }
};

TEST(WireChanges, readers_have_every_bit_whatever_is_lost) {
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    Neighbourhood world(seed);
    Link<WorldFrame> frames;
    Link<HapticReport> reports;
    std::mt19937 random(seed);
    for (int cycle = 0; cycle < 200; ++cycle) {
      // Confirmations are late, and for a time there are none.
      const bool confirms = cycle % 100 < 50 && random() % 3 == 0;
      ASSERT_TRUE(frames.send(world.frame_, random() % 4 == 0, confirms)) << "seed " << seed << " cycle " << cycle;
      ASSERT_TRUE(reports.send(world.report_, random() % 4 == 0, confirms)) << "seed " << seed << " cycle " << cycle;
      world.step(frames.confirmed, reports.confirmed);
    }
  }
}

TEST(WireChanges, a_message_with_nothing_new_is_small) {
  Neighbourhood world(3);
  for (GhostModel& ghost : world.frame_.ghosts) ghost.carried.reset();
  world.frame_.entering.clear();
  world.frame_.border.clear();
  Codec<WorldFrame> frames;
  Codec<HapticReport> reports;
  const auto whole = static_cast<double>(encoded(frames, world.frame_).size());
  const auto whole_report = static_cast<double>(encoded(reports, world.report_).size());
  world.frame_.base_stamp = world.frame_.stamp++;
  world.report_.base_stamp = world.report_.stamp++;
  EXPECT_LT(static_cast<double>(encoded(frames, world.frame_).size()), 0.2 * whole);
  EXPECT_LT(static_cast<double>(encoded(reports, world.report_).size()), 0.25 * whole_report);
}

TEST(WireChanges, without_its_base_a_message_is_lost_and_the_next_complete_one_is_read) {
  Neighbourhood world(5);
  Codec<WorldFrame> writer, late;
  (void)encoded(writer, world.frame_);
  world.step(world.frame_.stamp, {});
  const Bytes changes = encoded(writer, world.frame_);
  WorldFrame received;
  const std::vector<double> before = numbers_of(received);
  EXPECT_FALSE(late.decode(changes, received));
  EXPECT_EQ(numbers_of(received), before);
  world.step({}, {});
  ASSERT_TRUE(late.decode(encoded(writer, world.frame_), received));
  EXPECT_TRUE(same(received, world.frame_));
}

TEST(WireChanges, a_base_that_is_too_old_is_not_used) {
  Neighbourhood world(7);
  Link<WorldFrame> link;
  ASSERT_TRUE(link.send(world.frame_, false, true));
  for (std::uint64_t i = 0; i < kRememberedBases; ++i) {
    world.step(link.confirmed, {});
    ASSERT_TRUE(link.send(world.frame_, i + 1 < kRememberedBases, false));
  }
}

TEST(WireChanges, a_stamp_that_was_sent_with_two_contents_is_no_base) {
  Neighbourhood world(9);
  Link<WorldFrame> link;
  ASSERT_TRUE(link.send(world.frame_, false, true));
  world.frame_.states[0].state.position.x() += 1.0;
  ASSERT_TRUE(link.send(world.frame_, true, false));  // the same stamp again, but lost
  world.step(link.confirmed, {});
  EXPECT_TRUE(link.send(world.frame_, false, false));
}

TEST(WireChanges, of_another_session_is_no_base) {
  Neighbourhood world(11);
  Link<WorldFrame> link;
  ASSERT_TRUE(link.send(world.frame_, false, true));
  ++world.frame_.session;
  world.step(link.confirmed, {});
  EXPECT_TRUE(link.send(world.frame_, false, false));
}

TEST(WireChanges, overruled_states_are_not_sent_and_others_are_exact) {
  Neighbourhood world(13);
  HapticReport& report = world.report_;
  report.omits_overruled = true;
  report.islands.assign(kBodies, kOpenIsland);
  report.islands[3] = 3;
  Link<HapticReport> link;
  const auto state = [](const HapticReport& of, std::size_t i) {
    HapticReport one;
    one.members.assign(1, of.members[i]);
    return one;
  };
  (void)link.send(report, false, true);
  EXPECT_TRUE(same(state(link.received, 3), state(report, 3)));
  EXPECT_FALSE(same(state(link.received, 4), state(report, 4)));
  const std::size_t few = encoded(link.writer, report).size();
  // The island of another one closes: its state is sent.
  report.base_stamp = report.stamp++;
  report.islands[4] = 4;
  (void)link.send(report, false, true);
  EXPECT_TRUE(same(state(link.received, 3), state(report, 3)));
  EXPECT_TRUE(same(state(link.received, 4), state(report, 4)));
  report.omits_overruled = false;
  report.base_stamp.reset();
  EXPECT_GT(encoded(link.writer, report).size(), few + 100 * (kBodies - 2));
}

TEST(WireChanges, corrupt_changes_never_give_numbers_that_are_not_finite) {
  Neighbourhood world(17);
  Link<WorldFrame> link;
  ASSERT_TRUE(link.send(world.frame_, false, true));
  world.step(link.confirmed, {});
  const Bytes whole = encoded(link.writer, world.frame_);
  WorldFrame target;
  for (std::size_t at = 0; at < whole.size(); ++at) {
    for (const int with : {0x00, 0x01, 0x7f, 0x80, 0xff}) {
      Bytes bytes = whole;
      bytes[at] = static_cast<std::uint8_t>(with);
      (void)link.reader.decode(bytes, target);
      for (const double number : numbers_of(target)) ASSERT_TRUE(std::isfinite(number)) << "byte " << at;
    }
  }
}

}  // namespace
}  // namespace subworld
