#include "wire/last_messages.hpp"

#include "support/allocations.hpp"
#include "support/temporary_folder.hpp"
#include "support/wire_samples.hpp"
#include "wire/codec/codec.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

namespace subworld {
namespace {

std::vector<std::string> lines_of(const std::string& path) {
  std::ifstream file(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  return lines;
}

template <class M>
void keep(const M& sample, bool sent, std::uint32_t number = 0) {
  Codec<M> codec;
  keep_message({.number = number, .topic = static_cast<std::uint8_t>(kTopicIndex<M>), .sent = sent}, &sample,
               codec.encode(sample));
}

DeviceCommand a_command() {
  test::SampleMaker make(3);
  DeviceCommand command = make.make<DeviceCommand>();
  command.device = 2;
  command.stamp_s = 1.5;
  command.wrench.force = {1.0, -2.0, 0.25};
  command.pose.position = {0.5, 0.0, 0.125};
  command.last = true;
  return command;
}

/// A program with the memory's ring, which runs `act` and is killed.
void in_a_program(const MessageMemory& memory, std::size_t program, const std::function<void()>& act) {
  const pid_t child = fork();
  if (child == 0) {
    setenv(MessageMemory::kVariable, memory.place_of(program).c_str(), 1);
    open_messages();
    act();
    _exit(0);
  }
  ASSERT_EQ(waitpid(child, nullptr, 0), child);
}

TEST(MessageMemory, HasTheMessagesOfAProgramThatHasDied) {
  const TemporaryFolder folder;
  const MessageMemory memory({1, 1}, {});
  EXPECT_EQ(memory.place_of(2), "");
  in_a_program(memory, 1, [] {
    keep(a_command(), true);
    write_last_messages("/proc/never");  // the launcher does that
  });
  EXPECT_EQ(write_last_messages(memory.last_of(0), folder.path() + "/none.csv"), "");
  EXPECT_TRUE(lines_of(folder.path() + "/none.csv").empty()) << "no message was kept";
  EXPECT_EQ(write_last_messages(memory.last_of(1), folder.path() + "/one.csv"), "");
  EXPECT_EQ(lines_of(folder.path() + "/one.csv").size(), 2U);
  EXPECT_NE(write_last_messages(memory.last_of(1), folder.path() + "/no/one.csv"), "");
}

TEST(MessageMemory, PassesToARecorderWhatWasSentAndCountsWhatWasOverwritten) {
  constexpr std::uint32_t kMany = 20000;
  MessageMemory memory({1, 1}, {.recorded = true});
  const auto send = [](std::uint32_t first, std::uint32_t count) {
    const DeviceCommand command = a_command();
    Control order;
    for (std::uint32_t i = first; i < first + count; ++i) {
      keep(command, true, i);
      keep(command, false, i);
      if (i % 10 == 0) keep(order, true);
      if (i % 10 == 0) keep(order, false);
    }
  };
  std::vector<KeptMessage> taken;
  in_a_program(memory, 1, [&] { send(0, 50); });
  memory.take(taken, false);
  ASSERT_EQ(taken.size(), 50U) << "sent, and no orders";
  EXPECT_EQ(memory.sent(), 50U);
  for (std::uint32_t i = 0; i < 50; ++i) {
    EXPECT_EQ(taken[i].number, i);
    DeviceCommand command;
    EXPECT_TRUE(Codec<DeviceCommand>().decode(taken[i].cdr, command));
  }
  taken.clear();
  in_a_program(memory, 0, [&] { send(0, 50); });
  memory.take(taken, false);
  EXPECT_EQ(taken.size(), 55U) << "the world also records the orders that it receives";
  taken.clear();
  in_a_program(memory, 1, [&] { send(0, kMany); });
  memory.take(taken, true);
  EXPECT_EQ(memory.sent(), 50 + 55 + kMany);
  ASSERT_GT(taken.size(), 10U);
  EXPECT_LT(taken.size(), kMany);
  EXPECT_EQ(taken.back().number, kMany - 1);
  for (std::size_t i = 1; i < taken.size(); ++i) EXPECT_EQ(taken[i].number, taken[i - 1].number + 1);
}

TEST(MessageMemory, InLockStepAProgramWaitsForTheRecorder) {
  constexpr std::uint32_t kMany = 20000;
  MessageMemory memory({0, 1}, {.recorded = true, .waits = true});
  const pid_t child = fork();
  if (child == 0) {
    in_a_program(memory, 1, [] {
      for (std::uint32_t i = 0; i < kMany; ++i) keep(a_command(), true, i);
    });
    _exit(0);
  }
  std::vector<KeptMessage> taken;
  while (waitpid(child, nullptr, WNOHANG) == 0) memory.take(taken, false);
  memory.take(taken, true);
  ASSERT_EQ(taken.size(), kMany);
  for (std::uint32_t i = 0; i < kMany; ++i) ASSERT_EQ(taken[i].number, i);
}

// The last test: from here on this process has a memory of its own.
TEST(LastMessages, KeepsTheNewestWithoutAnAllocation) {
  const TemporaryFolder folder;
  const std::string path = folder.path() + "/last.csv";
  write_last_messages(path);
  EXPECT_TRUE(lines_of(path).empty()) << "there is no memory yet";
  open_messages();
  DeviceCommand command = a_command();
  Codec<DeviceCommand> codec;
  constexpr std::uint64_t kMany = 10000;
  (void)codec.encode(command);
  const long before = test::allocations();
  for (command.sequence = 0; command.sequence < kMany; ++command.sequence) {
    keep_message({.topic = static_cast<std::uint8_t>(kTopicIndex<DeviceCommand>), .sent = true}, &command,
                 codec.encode(command));
  }
  EXPECT_EQ(test::allocations(), before);
  Status status;
  status.program = ProgramKind::haptic_sim;
  status.instance = 1;
  status.state = "a state that is longer than its room";
  keep(status, false);
  // Of a long message the beginning is kept, and its lists are counted.
  HapticReport report;
  report.user = UserId{3};
  report.stamp = 77;
  report.stamp_s = 0.5;
  report.proxy.position = {1.0, 2.0, 3.0};
  report.members.resize(100);
  report.base_stamp = 76;
  keep(report, true);
  WorldFrame frame;
  frame.stamp = 78;
  frame.members.resize(7);
  keep(frame, false);
  write_last_messages(path);
  std::vector<std::string> lines = lines_of(path);
  ASSERT_GT(lines.size(), 3000U);
  for (std::string& line : lines) line = line.substr(line.find(',') + 1);
  const std::size_t commands = lines.size() - 4;
  for (std::size_t i = 1; i <= commands; ++i) {
    ASSERT_EQ(lines[i], "sent,device_command,2," + std::to_string(kMany - 1 - commands + i) +
                            ",1.5,221,0.5,0,0.125,1,-2,0.25,,last");
  }
  EXPECT_TRUE(lines[commands + 1].starts_with("received,status,1,0,0,")) << lines[commands + 1];
  EXPECT_TRUE(lines[commands + 1].ends_with(",,,,,,,,a state that ")) << lines[commands + 1];
  EXPECT_TRUE(lines[commands + 2].starts_with("sent,haptic_report,3,77,0.5,")) << lines[commands + 2];
  EXPECT_TRUE(lines[commands + 2].ends_with(",1,2,3,,,,100,")) << lines[commands + 2];
  EXPECT_TRUE(lines[commands + 3].starts_with("received,world_frame,0,78,0,")) << lines[commands + 3];
  EXPECT_TRUE(lines[commands + 3].ends_with(",,,,,,,7,complete")) << lines[commands + 3];
}

}  // namespace
}  // namespace subworld
