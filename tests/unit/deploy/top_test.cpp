// The table of `subworld top`.
#include "watch/top.hpp"
#include "watch/progress.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace subworld {
namespace {

using ::testing::HasSubstr;

TEST(Top, ShowsWhatAProgramPublishesAndWhereItRuns) {
  DomainView view{.domain = 70};
  Status world;
  world.state = "running";
  world.rate_hz = 250.0;
  world.missed_deadlines = 7;
  world.missed_by_os = 5;
  world.real_time_factor = 0.8;
  world.events.lost = 3;
  Status haptic;
  haptic.program = ProgramKind::haptic_sim;
  haptic.instance = 1;
  haptic.state = "running";
  haptic.waits_for = "device_sim 1";
  view.statuses = {world, haptic};
  RunningProgram here{.pid = 42, .name = "world_sim"};
  here.network.dds = "cyclonedds";
  view.programs = {here};
  const std::string table = table_of(view);
  EXPECT_THAT(table, HasSubstr("domain 70, 2 programs"));
  for (const char* part : {"cyclonedds", "42", "250", "7 (5)", "0.80", "lost 3"}) EXPECT_THAT(table, HasSubstr(part));
  for (const char* part : {"haptic_sim 1", "remote", "waits for device_sim 1"}) EXPECT_THAT(table, HasSubstr(part));
}

TEST(Top, NamesAProgramThatPublishesNothing) {
  DomainView view{.domain = 70, .launcher = 5};
  RunningProgram one{.pid = 42, .name = "device_sim"};
  one.suspended = true;
  view.programs = {one};
  EXPECT_THAT(table_of(view), HasSubstr("claimed by process 5"));
  EXPECT_THAT(table_of(view), HasSubstr("suspended"));
}

TEST(Top, AnOptionIsReadInBothForms) {
  EXPECT_EQ(value_of({"x", "--domain", "7", "--domain=8"}, "--domain"), "8");
  EXPECT_EQ(value_of({"x", "--domain"}, "--domain"), std::nullopt);
}

TEST(Progress, SaysWhetherTheRunIsPaused) {
  Settings settings;
  settings.duration_s = 8.0;
  EXPECT_EQ(progress_line({}, settings, 1), "reading 1 body");
  Status world;
  world.state = "running";
  world.steps = 1;
  world.time_s = 2.0;
  world.paused = true;
  EXPECT_EQ(progress_line({{{ProgramKind::world_sim, 0}, world}}, settings, 2), "t = 2.0 of 8 s; paused");
}

}  // namespace
}  // namespace subworld
