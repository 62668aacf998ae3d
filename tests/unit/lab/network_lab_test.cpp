// The lab of the network: its matrix, the account of numbered messages, percentiles and pass criteria.

#include "io/results/json.hpp"
#include "lab/network/cell.hpp"
#include "lab/network/ddsperf.hpp"
#include "lab/network/felt.hpp"
#include "lab/network/report.hpp"
#include "model/error.hpp"
#include "report/plots.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <regex>
#include <set>
#include <string>
#include <vector>

namespace subworld {
namespace {

TEST(NetworkCells, AreAllCombinationsWithTheVendorPairsOfASettingTogether) {
  NetworkAxes axes;
  axes.rates_hz = {100.0, 1000.0};
  axes.links = {"ideal", "delay 5ms", "loss 2%"};
  const std::vector<NetworkCell> cells = cells_of(axes);
  ASSERT_EQ(cells.size(), 4U * 2U * 2U * 3U);
  std::set<std::string> all;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    all.insert(to_text(cells[i]));
    EXPECT_EQ(setting_of(cells[i]), setting_of(cells[i - i % 4]));
  }
  EXPECT_EQ(all.size(), cells.size()) << "no cell is measured twice";
}

TEST(NetworkCells, LoopbackIsNotRepeatedForEachLink) {
  NetworkAxes axes;
  axes.transports = {"loopback"};
  axes.links = {"wifi", "lan", "4g"};
  const std::vector<NetworkCell> cells = cells_of(axes);
  EXPECT_EQ(cells.size(), 4U * 2U);
  for (const NetworkCell& cell : cells) EXPECT_EQ(columns_of(cell).at("delay_s"), 0.0);
}

TEST(NetworkCells, AWrongLinkIsRefused) {
  NetworkAxes axes;
  axes.links = {"lan", "wify"};
  EXPECT_THROW((void)cells_of(axes), Error);
}

TEST(NetworkArrivals, CountLossesBurstsDuplicatesAndOrderAfterTheStartUp) {
  constexpr std::int64_t kMs = 1'000'000, kStart = 1'000'000'000;
  Arrivals found;
  ArrivalBook book(found, 10, 30);
  for (const std::uint64_t number : {0, 5, 9, 10, 11, 13, 12, 13, 17, 18, 19, 40})
    book.add(number, kStart + static_cast<std::int64_t>(number) * kMs, 0.001);
  book.close(22, kStart + 10 * kMs, kStart + 24 * kMs);  // 14, 15, 16, 20 and 21 are lost
  EXPECT_EQ(found.received, 7U);
  EXPECT_EQ(found.duplicates, 1U);
  EXPECT_EQ(found.out_of_order, 1U);
  EXPECT_EQ(found.longest_burst, 3U);
  EXPECT_NEAR(found.longest_gap_s, 0.005, 1e-9) << "from the last arrival to the end of the sending";
  EXPECT_EQ(found.delay.count(), 7U);
}

TEST(NetworkArrivals, ALinkThatDeliversNothingIsOneGap) {
  Arrivals found;
  ArrivalBook book(found, 10, 30);
  book.close(30, 1'000'000'000, 3'000'000'000);
  EXPECT_EQ(found.received, 0U);
  EXPECT_EQ(found.longest_burst, 20U);
  EXPECT_NEAR(found.longest_gap_s, 2.0, 1e-9);
}

TEST(NetworkPercentiles, NeedTenSamplesBeyondThem) {
  Histogram times;
  EXPECT_TRUE(percentiles(times).at("max").is_null());
  for (int i = 0; i < 999; ++i) times.add(0.001);
  EXPECT_FALSE(percentiles(times).at("p90").is_null());
  EXPECT_TRUE(percentiles(times).at("p99").is_null());
  times.add(0.5);
  const Json json = percentiles(times);
  EXPECT_NEAR(json.at("p99").get<double>(), 0.001, 2e-5);
  EXPECT_TRUE(json.at("p99_9").is_null());
  EXPECT_EQ(json.at("max"), 0.5);
  EXPECT_EQ(json.at("n"), 1000);
}

CellFindings findings(std::uint64_t sent, std::uint64_t received, double round_trip_s) {
  CellFindings found{.planned = sent, .sent = sent};
  found.there.received = received;
  for (std::uint64_t i = 0; i < received; ++i) found.round_trip.delay.add(round_trip_s);
  return found;
}

TEST(NetworkCriteria, NameTheValueThatMisses) {
  const Json row = row_of({}, {}, findings(2000, 1900, 0.03), {});
  const Requirement fast = parse_requirement("round_trip_s_p99<0.02", row);
  const Requirement complete = parse_requirement("lost_ratio<0.1", row);
  const Requirement rare = parse_requirement("round_trip_s_p99_99<1", row);
  const std::vector<std::string> missed = missed_by(row, {fast, complete, rare});
  ASSERT_EQ(missed.size(), 2U);
  EXPECT_NE(missed[0].find("round_trip_s_p99<0.02: it is 0.03"), std::string::npos) << missed[0];
  EXPECT_NE(missed[1].find("was not measured"), std::string::npos) << missed[1];
}

TEST(NetworkCriteria, WrongOnesAreRefused) {
  const Json row = row_of({}, {}, {}, {});
  for (const char* text : {"", "lost_ratio", "lost_ratio<", "lost_ratio<x", "lost<1 2", "<1", "los_ratio<1", "link<1",
                           "failure<1", "lost_ratio<inf"})
    EXPECT_THROW((void)parse_requirement(text, row), Error) << text;
}

TEST(NetworkSentence, NamesTheLargestLoadThatAllVendorPairsCarry) {
  const auto row = [](const char* vendor, double rate_hz, std::uint64_t received) {
    NetworkCell cell{.world_dds = vendor};
    cell.rate_hz = rate_hz;
    return row_of(cell, {}, findings(2000, received, 0.001), {});
  };
  const Rows rows{row("fastdds", 100.0, 2000),  row("cyclonedds", 100.0, 2000),  //
                  row("fastdds", 500.0, 1990),  row("cyclonedds", 500.0, 2000),
                  row("fastdds", 1000.0, 2000), row("cyclonedds", 1000.0, 1000)};
  const std::vector<std::string> sentences = sentences_of(rows, {});
  ASSERT_EQ(sentences.size(), 1U);
  EXPECT_NE(sentences[0].find("carries 500 Hz x 256 bytes for 1 user"), std::string::npos) << sentences[0];
  EXPECT_NE(sentences_of(rows, {parse_requirement("lost<1", rows[0])})[0].find("carries 100 Hz"), std::string::npos);
}

constexpr const char* kOfDdsperf =
    "[7] participant vm:7: new (self)\n"
    "[7] 1.000  vm:8 size 256 mean 900us min 1us 50% 900us 90% 900us 99% 900us max 9000us cnt 100\n"
    "[7] 1.000  rss:7.2MB vcsw:1086 ivcsw:49 recvUC:5%+0%\n"
    "[7] 2.000  vm:8 size 256 mean 224.1us min 166.6us 50% 210us 90% 247.2us 99% 290us max 1794.5us cnt 99\n"
    "[7] 3.000  vm:8 size 256 mean 224.1us min 166.6us 50% 220us 90% 247.2us 99% 280us max 300.5us cnt 100\n"
    "[7] 4.000  vm:8 size 256 mean 224.1us min 166.6us 50% 230us 90% 247.2us 99% 270us max 300.5us cnt 100\n";

TEST(NetworkLab, RoundTripsOfDdsperfAreTwiceWhatItPrintsWithoutItsStartUp) {
  const Json figures = ddsperf_figures(kOfDdsperf, 100.0);
  EXPECT_DOUBLE_EQ(figures["p50"], 440e-6);
  EXPECT_DOUBLE_EQ(figures["p99"], 560e-6);
  EXPECT_DOUBLE_EQ(figures["max"], 3589e-6);
  EXPECT_EQ(figures["n"], 299);
}

TEST(NetworkLab, PingsThatDdsperfHasDroppedLeaveNoFigure) {
  const Json figures = ddsperf_figures(kOfDdsperf, 120.0);
  EXPECT_TRUE(figures["p50"].is_null());
  EXPECT_EQ(figures["n"], 299);
  EXPECT_TRUE(ddsperf_figures("", 100.0)["max"].is_null());
}

Json felt_row(const std::string& link, double rms, double p99) {
  Json row = felt_row_of({.link = link}, {.scene = "row"});
  row["user"] = 0;
  row["user_name"] = "left";
  row["force_error_rms"] = rms;
  row["force_error_p99"] = p99;
  row["reference_error"] = 0.01;
  row["missed_ratio"] = 0.0;
  row["real_time_factor_min"] = 1.0;
  return row;
}

TEST(FeltSentence, NamesTheLinksWithinAndBeyondTheBar) {
  Json other = felt_row("lan", 0.02, 0.01);
  other["haptic_dds"] = "cyclonedds";
  const std::string text = felt_sentence_of({felt_row("lan", 0.001, 0.03), other, felt_row("4g", 0.03, 0.08),
                                             felt_row("wifi", 0.035, 0.07), felt_row("hotel", 0.2, 0.02)});
  EXPECT_EQ(text,
            "scene row: the felt force is within the imperceptible bar (RMS 3.5 %, p99 7 %) over lan (RMS 2 %, p99 1 "
            "%), wifi (RMS 3.5 %, p99 7 %); beyond it over 4g (RMS 3 %, p99 8 %: fastdds > fastdds, user left), hotel "
            "(RMS 20 %, p99 2 %: fastdds > fastdds, user left)");
}

TEST(FeltSentence, DecidesNothingWhereTheMachineOrTheReferenceIsAtFault) {
  Json late = felt_row("lan", 0.1, 0.1), slow = late, failed = felt_row("4g", 0.0, 0.0);
  late["missed_ratio"] = 0.002;
  slow["real_time_factor_min"] = 0.9;
  failed["failure"] = "no programs";
  Json no_force = felt_row("wifi", std::nan(""), std::nan(""));
  no_force["reference_error"] = nullptr;
  Json chaotic = felt_row("hotel", 0.05, 0.05);
  chaotic["reference_error"] = 0.04;
  EXPECT_EQ(felt_sentence_of({late, slow, failed, no_force, chaotic}),
            "scene row: the felt force is within the imperceptible bar (RMS 3.5 %, p99 7 %) over no link; undecided "
            "over lan (RMS 10 %, p99 10 % in a run that the machine disturbed), 4g (not measured with fastdds > "
            "fastdds), wifi (the reference felt no force), hotel (the reference error of user left is 4 %)");
  const std::string text = felt_sentence_of({late, felt_row("lan", 0.05, 0.05)});
  EXPECT_NE(text.find("beyond it over lan (RMS 5 %"), std::string::npos) << "an undisturbed run decides: " << text;
}

TEST(FeltCells, AreEachLinkWithEachVendorPair) {
  const std::vector<FeltCell> cells = felt_cells_of({}, {.scene = "row"});
  ASSERT_EQ(cells.size(), 2U * 4U);
  std::set<std::string> commands;
  for (const FeltCell& cell : cells) commands.insert(command_of(cell, {.scene = "row"}));
  EXPECT_EQ(commands.size(), cells.size());
  EXPECT_TRUE(felt_cells_of({}, {}).empty());
}

TEST(FeltProgress, NamesTheGateWithoutItsExplanation) {
  Json row = felt_row("lan", 0.01, 0.02);
  const auto text_of = [&](const std::string& verdict) {
    row["verdict"] = verdict;
    const std::string text = felt_result_text({row});
    return text.substr(text.find("verdict "));
  };
  EXPECT_EQ(text_of("ok; user 0: lost frames 43, by the network; user 0: late reports 7 % of reports, by the network"),
            "verdict ok; user 0: lost frames 43, by the network; user 0: late reports 7 % of reports, by the network");
  EXPECT_EQ(text_of("quality gate missed: user 0: lateness p99 0.31 ms: the OS woke the loop late (bare loops: 2); run "
                    "again: now"),
            "verdict quality gate missed: user 0: lateness p99 0.31 ms");
  EXPECT_EQ(text_of("unstable: energy that the bodies gained 3 J: less delay"),
            "verdict unstable: energy that the bodies gained 3 J");
  EXPECT_EQ(text_of("ok"), "verdict ok");
}

TEST(LabPlots, ATextMayHaveCharactersThatGnuplotWouldReadAsItsOwn) {
  const std::string text = R"(loss 2% "wifi" \t `echo run`)";
  const std::vector<std::string> pictures =
      svg_of({{.title = text,
               .x_label = text,
               .y_label = text,
               .x_ticks = {},
               .x_names = {"100%", "two\nlines"},
               .series = {{.title = text, .colour = "#000000", .points = {{1, 2}}}},
               .levels = {{text, "#000000", 1.0}}}});
  ASSERT_EQ(pictures.size(), 1U);
  std::string picture = std::regex_replace(pictures[0], std::regex("&quot;"), "\"");
  std::size_t times = 0;
  for (std::size_t at = picture.find(text); at != std::string::npos; at = picture.find(text, at + 1)) ++times;
  EXPECT_EQ(times, 5U) << picture;
  EXPECT_NE(picture.find("100%<"), std::string::npos);
  EXPECT_EQ(picture.find("100%%"), std::string::npos);
  EXPECT_NE(picture.find("two<"), std::string::npos) << "a line ends there";
}

}  // namespace
}  // namespace subworld
