#include "link/model.hpp"
#include "link_check/statistics.hpp"
#include "link_check/validate.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <vector>

namespace subworld {
namespace {

constexpr std::uint64_t kPackets = 200'000;
constexpr double kPeriod_s = 0.001;
constexpr int kBytes = 100;

/// As many standard errors as a right sample exceeds once in a million.
constexpr double kErrors = 4.9;

LinkStatistics passed(const std::string& text, std::uint64_t sent = kPackets) {
  return expected_statistics(parse_link(text), sent, kPeriod_s, kBytes);
}

/// Largest distance between the distribution of the delays and a given one (Kolmogorov 1933).
double distance(const LinkStatistics& link, const std::function<double(double)>& distribution) {
  double largest = 0.0;
  const double n = static_cast<double>(link.delays_s.size());
  for (std::size_t i = 0; i < link.delays_s.size(); ++i) {
    const double at = distribution(link.delays_s[i]);
    largest =
        std::max({largest, std::abs(at - static_cast<double>(i) / n), std::abs(at - static_cast<double>(i + 1) / n)});
  }
  return largest;
}

/// A right sample exceeds it once in a million: 2 exp(-2 n d^2).
double largest_distance(const LinkStatistics& link) {
  return std::sqrt(0.5 * std::log(2e6) / static_cast<double>(link.delays_s.size()));
}

TEST(LinkModel, AnIdealLinkDeliversEachPacketAtOnceAndInOrder) {
  const LinkStatistics link = passed("");
  EXPECT_EQ(link.received, kPackets);
  EXPECT_EQ(link.reordered + link.duplicated, 0U);
  EXPECT_EQ(link.delays_s.back(), 0.0);
}

TEST(LinkModel, ADelayWithoutJitterIsExact) {
  const LinkStatistics link = passed("delay 20ms");
  EXPECT_NEAR(link.delays_s.front(), 0.02, 1e-9);
  EXPECT_NEAR(link.delays_s.back(), 0.02, 1e-9);
  EXPECT_EQ(link.reordered, 0U);
}

TEST(LinkModel, JitterIsUniform) {
  const LinkStatistics link = passed("delay 20ms 8ms");
  EXPECT_LT(distance(link, [](double s) { return std::clamp((s - 0.012) / 0.016, 0.0, 1.0); }), largest_distance(link));
}

TEST(LinkModel, JitterIsNormal) {
  const LinkStatistics link = passed("delay 20ms 3ms distribution normal");
  EXPECT_LT(distance(link, [](double s) { return 0.5 * std::erfc((0.02 - s) / (0.003 * std::sqrt(2.0))); }),
            largest_distance(link) + 1e-4);  // it is cut off at four standard deviations
  EXPECT_NEAR(link.delay_deviation_s, 0.003, 0.003 * kErrors / std::sqrt(2.0 * kPackets) + 3e-6);
}

TEST(LinkModel, JitterIsOfParetoWithThePowerThree) {
  const LinkStatistics link = passed("delay 20ms 3ms distribution pareto");
  const auto below = [](double s) {
    const double x = 0.75 * (s - 0.02) / 0.003 + 1.5;
    return x >= 4.5 - 1e-6 ? 1.0 : 1.0 - std::pow(std::max(1.0, x), -3.0);
  };
  // A share of 4.5^-3 is cut off at the largest delay.
  EXPECT_LT(distance(link, below), largest_distance(link) + std::pow(4.5, -3.0));
  EXPECT_NEAR(link.delays_s.front(), 0.02 - 0.003 * 2.0 / 3.0, 1e-6);
  EXPECT_NEAR(link.delays_s.back(), 0.02 + 0.003 * 4.0, 1e-6);
}

TEST(LinkModel, AJitterBeyondTheDelayCannotDeliverBeforeTheSending) {
  const LinkStatistics link = passed("delay 2ms 10ms");
  EXPECT_GE(link.delays_s.front(), 0.0);
  EXPECT_EQ(link.quantile_s(0.3), 0.0);  // 40 % of the draws are below zero
}

TEST(LinkModel, IndependentLossIsWithinItsBinomialInterval) {
  for (const double percent : {0.5, 8.0, 50.0}) {
    const LinkStatistics link = passed(std::to_string(percent).insert(0, "loss ") + "%");
    const double loss = percent / 100.0;
    EXPECT_NEAR(link.loss_ratio(), loss, kErrors * std::sqrt(loss * (1.0 - loss) / kPackets));
    const double burst = 1.0 / (1.0 - loss);
    EXPECT_NEAR(link.burst_mean(), burst,
                kErrors * std::sqrt(burst * (burst - 1.0) / static_cast<double>(link.bursts)));
  }
  EXPECT_EQ(passed("loss 100%", 1000).received, 0U);
}

TEST(LinkModel, BurstsHaveTheLengthThatTheChainGives) {
  // p / (p + r) of the packets are lost, 1 / r in a row.
  const LinkStatistics link = passed("loss gemodel 1% 25%");
  const double loss = 0.01 / 0.26, burst = 4.0;
  const LossModel model = parse_link("loss gemodel 1% 25%").loss;
  EXPECT_NEAR(model.loss_ratio(), loss, 1e-12);
  EXPECT_NEAR(burst_mean(model), burst, 1e-9);
  EXPECT_GT(loss_deviation(model, kPackets), 2.0 * std::sqrt(loss * (1.0 - loss) / kPackets))
      << "bursts widen the interval";
  EXPECT_NEAR(link.loss_ratio(), loss, kErrors * loss_deviation(model, kPackets));
  EXPECT_NEAR(link.burst_mean(), burst, kErrors * std::sqrt(burst * (burst - 1.0) / static_cast<double>(link.bursts)));
}

TEST(LinkModel, BothStatesMayLose) {
  const LossModel model = parse_link("loss gemodel 2% 10% 70% 1%").loss;
  const LinkStatistics link = passed("loss gemodel 2% 10% 70% 1%", 4 * kPackets);
  const double bad = 0.02 / 0.12;
  EXPECT_NEAR(model.loss_ratio(), bad * 0.7 + (1.0 - bad) * 0.01, 1e-12);
  EXPECT_NEAR(link.loss_ratio(), model.loss_ratio(), kErrors * loss_deviation(model, 4 * kPackets));
  EXPECT_NEAR(link.burst_mean(), burst_mean(model), 0.05);
}

/// The interval of a correlated loss is as wide as many short links vary.
TEST(LinkModel, TheDeviationOfALossIsThatOfManyLinks) {
  const LinkSettings settings = parse_link("loss gemodel 1% 20%");
  constexpr int kLinks = 2000, kShort = 2000;
  double sum = 0.0, squares = 0.0;
  for (int i = 0; i < kLinks; ++i) {
    LinkModel model(settings, 1000U + i);
    int lost = 0;
    for (int n = 0; n < kShort; ++n) {
      const PacketFate fate = model.arrive(n * 1'000'000, kBytes);
      lost += fate.drop == LinkDrop::loss ? 1 : 0;
      for (int c = 0; c < fate.copies; ++c) model.leave();
    }
    sum += lost / double{kShort};
    squares += lost / double{kShort} * lost / double{kShort};
  }
  const double mean = sum / kLinks;
  const double deviation = std::sqrt(squares / kLinks - mean * mean);
  EXPECT_NEAR(deviation, loss_deviation(settings.loss, kShort), 0.1 * deviation);
}

TEST(LinkModel, DuplicatesArriveTwice) {
  const LinkStatistics link = passed("duplicate 3%");
  EXPECT_NEAR(link.duplicate_ratio(), 0.03, kErrors * std::sqrt(0.03 * 0.97 / kPackets));
  EXPECT_EQ(link.received, kPackets);
  const LinkStatistics both = passed("duplicate 30% loss 40%");
  EXPECT_NEAR(both.loss_ratio(), 0.4 * 0.7, kErrors * std::sqrt(0.28 * 0.72 / kPackets)) << "one of two copies is lost";
}

TEST(LinkModel, ReorderedPacketsLeaveAtOnce) {
  const LinkStatistics link = passed("delay 10ms reorder 5%");
  const auto at_once = std::ranges::count(link.delays_s, 0.0);
  EXPECT_NEAR(static_cast<double>(at_once) / kPackets, 0.05, kErrors * std::sqrt(0.05 * 0.95 / kPackets));
  EXPECT_GT(link.reorder_ratio(), 0.2) << "those that are overtaken arrive after a later packet";
  const LinkStatistics rare = passed("delay 10ms reorder 100% gap 10");
  EXPECT_EQ(std::ranges::count(rare.delays_s, 0.0), kPackets / 10) << "each tenth packet";
}

TEST(LinkModel, JitterReordersButNotBehindARate) {
  EXPECT_GT(passed("delay 10ms 5ms").reorder_ratio(), 0.3);
  EXPECT_EQ(passed("delay 10ms 5ms rate 100mbit").reordered, 0U);
}

/// Packets of 1000 bytes that arrive all at once.
std::vector<PacketFate> burst(const std::string& text, int count) {
  LinkModel model(parse_link(text), 1);
  std::vector<PacketFate> fates;
  for (int i = 0; i < count; ++i) fates.push_back(model.arrive(0, 1000));
  return fates;
}

TEST(LinkModel, ARateSpreadsABurst) {
  const std::vector<PacketFate> fates = burst("delay 3ms rate 8mbit", 100);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(fates[i].departure_ns[0], 3'000'000 + (i + 1) * 1'000'000);
}

TEST(LinkModel, AFullQueueDropsUntilPacketsLeave) {
  const std::vector<PacketFate> fates = burst("delay 3ms limit 20", 100);
  const auto delivered = std::ranges::count_if(fates, [](const PacketFate& fate) { return fate.copies == 1; });
  EXPECT_EQ(delivered, 20);
  EXPECT_EQ(fates.back().drop, LinkDrop::queue);
  LinkModel model(parse_link("delay 3ms limit 1"), 1);
  EXPECT_EQ(model.arrive(0, 1000).copies, 1);
  EXPECT_EQ(model.arrive(0, 1000).copies, 0);
  model.leave();
  EXPECT_EQ(model.arrive(0, 1000).copies, 1);
}

TEST(LinkModel, AnOutageDropsThePacketsOfItsTime) {
  LinkModel model(parse_link("outage from 2s for 500ms every 3s"), 1);
  const auto passes = [&](double t_s) { return model.arrive(std::llround(1e9 * t_s), kBytes).copies == 1; };
  for (const double t_s : {0.0, 1.999, 2.5, 4.999, 5.5}) EXPECT_TRUE(passes(t_s)) << t_s;
  LinkModel again(parse_link("outage from 2s for 500ms every 3s"), 1);
  for (const double t_s : {2.0, 2.499, 5.0, 5.499, 8.2})
    EXPECT_EQ(again.arrive(std::llround(1e9 * t_s), kBytes).drop, LinkDrop::outage) << t_s;
}

TEST(LinkValidation, TheProbesDoNotFillTheLinkThatTheyMeasure) {
  for (const char* text : {"rate 100kbit", "delay 30ms 5ms rate 64kbit", "delay 1s limit 50", "wifi", "ideal"}) {
    const LinkSettings settings = parse_link(text);
    const double rate_hz = probe_rate_hz(settings);
    const LinkStatistics link = expected_statistics(settings, 20'000, 1.0 / rate_hz, kProbeBytes);
    const double sending_s = settings.rate_bit_s > 0.0 ? 8.0 * kProbeBytes / settings.rate_bit_s : 0.0;
    EXPECT_LE(rate_hz, 1000.0) << text;
    EXPECT_LE(link.delay_mean_s, 1.01 * settings.delay_s + 2.0 * sending_s) << text;
    EXPECT_NEAR(link.loss_ratio(), settings.loss.loss_ratio(), 0.01) << text;
  }
}

std::vector<std::int64_t> departures(const std::string& text, std::uint64_t seed) {
  LinkModel model(parse_link(text), seed);
  std::vector<std::int64_t> all;
  for (int i = 0; i < 1000; ++i) all.push_back(model.arrive(i * 1'000'000, kBytes).departure_ns[0] - i * 1'000'000);
  return all;
}

TEST(LinkModel, TheSeedDecidesAllDraws) {
  EXPECT_EQ(departures("wifi", 7), departures("wifi", 7));
  EXPECT_NE(departures("wifi", 7), departures("wifi", 8));
}

TEST(LinkModel, AnotherDelayLosesTheSamePackets) {
  const auto lost = [](const std::string& text) {
    std::vector<bool> all;
    for (const std::int64_t one : departures(text, 7)) all.push_back(one < 0);
    return all;
  };
  EXPECT_EQ(lost("delay 1ms loss 8%"), lost("delay 50ms 10ms distribution normal loss 8%"));
}

}  // namespace
}  // namespace subworld
