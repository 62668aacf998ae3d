// Rows that the file does not accept: a pipe with a slow reader.
#include "io/records/history.hpp"

#include "io/records/history_reader.hpp"
#include "io/records/mcap_reader.hpp"
#include "io/records/mcap_writer.hpp"
#include "io/records/trace.hpp"
#include "io/results/json.hpp"
#include "rt/cyclic.hpp"
#include "rt/wall_clock.hpp"
#include "support/temporary_folder.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>

namespace subworld {
namespace {

constexpr std::size_t kRing = 100;
constexpr std::size_t kTogether = 10;

/// Rows of 10 kB; a pipe holds a few of them.
History::Format wide_rows() {
  return {.width = 1,
          .head = "",
          .row = [](std::string& text, std::span<const double> row) { text += fmt::format("{:10000}\n", row[0]); },
          .rows = kRing};
}

TEST(RecordingFile, ReplacesAnEarlierOneWithItsFirstMessages) {
  const TemporaryFolder folder;
  const std::string file = folder.path() + "/run.mcap";
  const std::array<std::uint8_t, 1> byte{7};
  const auto record = [&](std::uint32_t messages) {
    mcap::Writer writer(file);
    const std::uint16_t channel = writer.add_channel(writer.add_schema("S", "omgidl", ""), "/s", "cdr");
    writer.attach("settings.json", "application/json", "{}", 1);
    for (std::uint32_t i = 0; i < messages; ++i) writer.write(channel, i, i, byte);
    writer.finish();
    return mcap::Reader(file).messages();
  };
  EXPECT_EQ(record(3), 3U);
  EXPECT_EQ(record(0), 3U) << "of a run that never started";
  EXPECT_EQ(record(2), 2U);
  std::filesystem::remove(file);
  EXPECT_EQ(record(0), 0U);
}

class SlowFile : public ::testing::Test {
 protected:
  SlowFile() : path_(folder_.path() + "/pipe") {
    mkfifo(path_.c_str(), 0600);
    reader_ = open(path_.c_str(), O_RDONLY | O_NONBLOCK);
  }
  ~SlowFile() override { close(reader_); }

  /// Ten rows that belong together.
  static bool put(History& history, bool may_wait) {
    if (!history.make_room(kTogether, may_wait)) return false;
    for (std::size_t i = 0; i < kTogether; ++i) history.row({static_cast<double>(i)});
    return true;
  }
  /// Reads until all writers have closed; returns the number of rows.
  std::size_t drain() const {
    fcntl(reader_, F_SETFL, 0);
    std::array<char, 65536> piece{};
    std::size_t rows = 0;
    for (ssize_t got = 1; got > 0;) {
      got = read(reader_, piece.data(), piece.size());
      rows += static_cast<std::size_t>(std::count(piece.begin(), piece.begin() + std::max<ssize_t>(got, 0), '\n'));
    }
    return rows;
  }

  const TemporaryFolder folder_;
  const std::string path_;
  int reader_ = -1;
};

TEST_F(SlowFile, RowsThatBelongTogetherAreThereTogetherOrNotAtAll) {
  std::size_t written = 0, rows = 0;
  auto history = std::make_unique<History>(path_, wide_rows(), nullptr);
  for (int i = 0; i < 50; ++i) written += put(*history, false) ? kTogether : 0;
  EXPECT_GE(written, kRing);
  EXPECT_LT(written, 50 * kTogether);
  EXPECT_FALSE(put(*history, false));
  std::thread reader([&] { rows = drain(); });
  history.reset();
  reader.join();
  EXPECT_EQ(rows, written);
}

TEST_F(SlowFile, AWriterThatMayWaitLosesNothing) {
  std::size_t rows = 0;
  auto history = std::make_unique<History>(path_, wide_rows(), nullptr);
  std::thread reader([&] { rows = drain(); });
  for (int i = 0; i < 50; ++i) EXPECT_TRUE(put(*history, true));
  EXPECT_EQ(history->dropped(), 0U);
  EXPECT_FALSE(history->make_room(kRing + 1, true)) << "more than there ever is";
  history.reset();
  reader.join();
  EXPECT_EQ(rows, 50 * kTogether);
}

TEST(FullDisk, IsNotWaitedFor) {
  History history("/dev/full", wide_rows(), nullptr);
  std::size_t written = 0;
  for (; written < 10 * kRing && history.make_room(1, true); ++written) history.row({0.0});
  EXPECT_GE(written, kRing);
  EXPECT_LT(written, 10 * kRing);
  history.finish();
  EXPECT_NE(history.fault().find("/dev/full"), std::string::npos);
}

/// The events of one that another machine has written are there by the clock of this one.
TEST(Traces, AreMergedByTheClockOfThisMachine) {
  const TemporaryFolder folder;
  const std::int64_t clock_ns = wall_ns() - to_ns(Clock::now());
  const auto part = [&](const std::string& name, std::int64_t ahead_ns) {
    return folder.write(name, fmt::format("[\n{{\"ph\":\"M\",\"args\":{{\"wall_minus_steady_ns\":{}}}}},\n"
                                          "{{\"ph\":\"i\",\"name\":\"{}\",\"ts\":1000.250,\"s\":\"p\"}}\n]\n",
                                          clock_ns + ahead_ns, name));
  };
  // The other one has started 5 s later, and its wall clock is 2 s ahead.
  merge_traces({{part("here", 0)}, {part("there", 5'000'000'000), 2.0}, {folder.path() + "/missing"}},
               folder.path() + "/all");
  const Json all = read_json(folder.path() + "/all");
  ASSERT_EQ(all.size(), 4U);
  EXPECT_EQ(all[1]["ts"], 1000.250);
  EXPECT_EQ(all[3]["name"], "there");
  EXPECT_NEAR(all[3]["ts"].get<double>(), 3'001'000.0, 900'000.0);  // a busy machine reads the clocks late
}

// A body at 1000 km moves by micrometres; ordinary numbers stay short.
TEST(HistoryOfAProgram, HoldsMicrometresFarAway) {
  const TemporaryFolder folder;
  const std::string path = folder.path() + "/far.csv";
  History history(path, "time_s,x_m,y_m", {});
  history.row({0.1, 1e6 + 2e-6, 1.0 / 3.0});
  history.finish();
  HistoryReader rows(path);
  ASSERT_TRUE(rows.next());
  EXPECT_NEAR(rows.at("x_m"), 1e6 + 2e-6, 1e-8);
  EXPECT_EQ(rows.at("y_m"), 0.333333333);
}

TEST(HistoryOfAProgram, IsReadRowByRowAsFarAsItIsComplete) {
  const TemporaryFolder folder;
  HistoryReader rows(folder.write("a.csv",
                                  "time_s,force_x_n,force_y_n,force_z_n\n0.1,2,3,6\n0.2,1\n0.3,,1,nan\n0.4,a,1,1\n"
                                  "0.5,1,1,1,1\n\n0.6,1,2,2\n0.7,1,2"));
  ASSERT_TRUE(rows.next());
  EXPECT_EQ(rows.at("time_s"), 0.1);
  EXPECT_EQ(rows.norm("force", "n"), 7.0);
  EXPECT_EQ(rows.at("x"), 0.0);
  ASSERT_TRUE(rows.next());
  EXPECT_EQ(rows.at("time_s"), 0.3);
  EXPECT_TRUE(std::isnan(rows.at("force_x_n"))) << "an empty cell";
  ASSERT_TRUE(rows.next());
  EXPECT_EQ(rows.value(*rows.find("time_s")), 0.6);
  EXPECT_FALSE(rows.next());
  EXPECT_EQ(rows.at("time_s"), 0.6) << "the last complete row";
  EXPECT_FALSE(HistoryReader(folder.path() + "/none.csv").next());
}

}  // namespace
}  // namespace subworld
