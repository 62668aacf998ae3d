#include "wire/last_messages.hpp"

#include "support/allocations.hpp"
#include "support/temporary_folder.hpp"
#include "support/wire_samples.hpp"
#include "wire/codec.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <fstream>
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

// One test: a process has one memory.
TEST(LastMessages, KeepsTheNewestWithoutAnAllocation) {
  const TemporaryFolder folder;
  const std::string path = folder.path() + "/last.csv";
  write_last_messages(path);
  EXPECT_TRUE(lines_of(path).empty()) << "there is no memory yet";
  keep_last_messages();
  test::SampleMaker make(3);
  DeviceCommand command = make.make<DeviceCommand>();
  command.device = 2;
  command.stamp_s = 1.5;
  command.wrench.force = {1.0, -2.0, 0.25};
  command.pose.position = {0.5, 0.0, 0.125};
  command.last = true;
  const long before = test::allocations();
  for (std::size_t i = 0; i <= kLastMessages; ++i) {
    command.sequence = i;
    keep_message(kTopicIndex<DeviceCommand>, true, 216, &command);
  }
  EXPECT_EQ(test::allocations(), before);
  Status status;
  status.program = ProgramKind::haptic_sim;
  status.instance = 1;
  status.state = "a state that is longer than its room";
  keep_message(kTopicIndex<Status>, false, 99, &status);
  write_last_messages(path);
  const std::vector<std::string> lines = lines_of(path);
  ASSERT_EQ(lines.size(), kLastMessages + 1);
  const auto from_direction = [](const std::string& line) { return line.substr(line.find(',') + 1); };
  EXPECT_EQ(from_direction(lines[1]), "sent,device_command,2,2,1.5,216,0.5,0,0.125,1,-2,0.25,,last");
  EXPECT_EQ(from_direction(lines[kLastMessages - 1]),
            "sent,device_command,2," + std::to_string(kLastMessages) + ",1.5,216,0.5,0,0.125,1,-2,0.25,,last");
  EXPECT_EQ(from_direction(lines.back()), "received,status,1,0,0,99,,,,,,,,a state that ");
}

TEST(LastMessages, OfAnotherProcessAreInTheLaunchersMemory) {
  const TemporaryFolder folder;
  const MessageMemory memory(2);
  EXPECT_EQ(memory.place_of(2), "");
  EXPECT_EQ(memory.place_of(1).substr(memory.place_of(1).find(':')), ":1");
  EXPECT_EQ(memory.write(0, folder.path() + "/none.csv"), "");
  EXPECT_TRUE(lines_of(folder.path() + "/none.csv").empty()) << "no message was kept";
}

}  // namespace
}  // namespace subworld
