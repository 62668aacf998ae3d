// The last messages of all programs before a fault: `logs/last_PROGRAM.csv`.
#include "process/faults/ends.hpp"

namespace subworld::test {
namespace {

struct MessageRow {
  double time_s = 0.0;
  bool sent = false;
  std::string topic;
  std::uint64_t number = 0;
};

std::vector<MessageRow> read_messages(const std::string& file) {
  std::ifstream stream(file);
  std::vector<MessageRow> rows;
  std::string line;
  std::getline(stream, line);
  EXPECT_TRUE(line.starts_with("time_s,direction,topic,user,number,stamp_s,bytes,")) << file << ": " << line;
  while (std::getline(stream, line)) {
    std::vector<std::string> cells;
    std::istringstream text(line);
    for (std::string cell; std::getline(text, cell, ',');) cells.push_back(cell);
    if (cells.size() < 7) ADD_FAILURE() << line;
    if (cells.size() >= 7) rows.push_back({std::stod(cells[0]), cells[1] == "sent", cells[2], std::stoull(cells[4])});
  }
  return rows;
}

/// The newest message of a topic and direction.
MessageRow newest(const std::vector<MessageRow>& rows, const std::string& topic, bool sent) {
  const auto is_it = [&](const MessageRow& row) { return row.topic == topic && row.sent == sent; };
  const auto found = std::find_if(rows.rbegin(), rows.rend(), is_it);
  EXPECT_NE(found, rows.rend()) << topic;
  return found == rows.rend() ? MessageRow{} : *found;
}

class LastMessages : public RunEnds {
 protected:
  [[nodiscard]] std::vector<std::string> files() const {
    std::vector<std::string> found;
    for (const auto& entry : std::filesystem::directory_iterator(out() + "/logs"))
      if (entry.path().filename().string().starts_with("last_")) found.push_back(entry.path().filename());
    std::ranges::sort(found);
    return found;
  }
};

class LastMessagesOf : public LastMessages, public ::testing::WithParamInterface<std::string> {};

TEST_P(LastMessagesOf, AKilledProgramAndItsPeersFitTogether) {
  start("realtime", GetParam(), "1000");
  if (HasFatalFailure()) return;
  std::this_thread::sleep_for(std::chrono::milliseconds(700));
  signal("haptic_sim", SIGKILL);
  ASSERT_EQ(process_->wait(), 1) << process_->err();
  ASSERT_EQ(files(),
            (std::vector<std::string>{"last_device_sim_0.csv", "last_haptic_sim_0.csv", "last_world_sim.csv"}));
  EXPECT_NE(process_->out().find(out() + "/logs/last_*.csv"), std::string::npos) << process_->out();
  const auto haptic = read_messages(out() + "/logs/last_haptic_sim_0.csv");
  const auto world = read_messages(out() + "/logs/last_world_sim.csv");
  const auto device = read_messages(out() + "/logs/last_device_sim_0.csv");
  for (const auto& rows : {haptic, world, device}) {
    ASSERT_FALSE(rows.empty());
    EXPECT_TRUE(std::ranges::is_sorted(rows, {}, &MessageRow::time_s));
  }
  EXPECT_GT(haptic.back().time_s - haptic.front().time_s, 0.7) << "the last second before the fault";
  // What it sent last is what they received last, or one less where it died while it sent.
  const MessageRow report = newest(haptic, "haptic_report", true), command = newest(haptic, "device_command", true);
  const MessageRow received = newest(world, "haptic_report", false);
  EXPECT_LE(report.number - received.number, 1U);
  EXPECT_LE(command.number - newest(device, "device_command", false).number, 1U);
  EXPECT_LT(std::abs(received.time_s - report.time_s), 0.1);
  EXPECT_GE(newest(world, "world_frame", true).number, newest(haptic, "world_frame", false).number);
  EXPECT_GE(newest(device, "device_state", true).number, newest(haptic, "device_state", false).number);

  EXPECT_EQ(run(scene("press"), {"--duration", "0.1"}).code, 0);
  EXPECT_TRUE(files().empty()) << "after a run that has not failed";
}

INSTANTIATE_TEST_SUITE_P(Vendors, LastMessagesOf, ::testing::Values("cyclonedds"),
                         [](const auto& one) { return one.param; });
INSTANTIATE_TEST_SUITE_P(FullRealtime, LastMessagesOf, ::testing::Values("fastdds"),
                         [](const auto& one) { return one.param; });

TEST_F(LastMessages, AreWrittenWhereTheLauncherIsKilled) {
  start("lockstep", "mixed", "1000");
  if (HasFatalFailure()) return;
  process_->signal(SIGKILL);
  ASSERT_TRUE(process_->wait());
  ASSERT_TRUE(eventually([&] { return running(out()).empty(); }));
  EXPECT_EQ(files().size(), 3U);
}

TEST_F(ByHandEnds, AProgramThatFailsWritesItsLastMessagesBesideItsResults) {
  start_run("lockstep", "fastdds", {"--wait", "2"});
  if (HasFatalFailure()) return;
  device_->signal(SIGKILL);
  EXPECT_EQ(haptic_->wait(), 1) << haptic_->err();
  const auto rows = read_messages(out() + "/last_haptic_sim_0.csv");
  EXPECT_GT(newest(rows, "device_state", false).number, 0U);
  world_->signal(SIGTERM);
  EXPECT_TRUE(world_->wait());
}

}  // namespace
}  // namespace subworld::test
