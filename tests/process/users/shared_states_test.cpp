// The states of a device that the other users' programs get in real time.
#include "process/process_test.hpp"
#include "rt/cyclic.hpp"
#include "wire/bus.hpp"

namespace subworld::test {
namespace {

class SharedStates : public ProcessTest, public ::testing::WithParamInterface<std::string> {};

TEST_P(SharedStates, AreFewerAndTellOthersWhereADeviceIs) {
  Process run(run_words(scene("lift"), {"--mode", "realtime", "--duration", "2", "--dds", GetParam()}), folder_.path());
  const Network network{.dds = GetParam(), .domain = domain_.number()};
  Settings settings;
  settings.mode = Mode::realtime;
  const auto bus = open_bus(network, settings, 0.001, "test");
  auto own = bus->reader<DeviceState>(device_partition(1));
  auto shared = bus->shared_device_reader(device_partition(1), kShared_s);
  auto reports = bus->reader<HapticReport>(user_partition(0));
  int of_own = 0, of_shared = 0, aged = 0;
  DeviceState state;
  HapticReport report;
  std::optional<int> code;
  while (!(code = run.wait(0.0))) {
    bus->wait(0.01);
    const bool both = of_shared > 0;
    while (shared.take(state) == Take::sample) ++of_shared;
    while (own.take(state) == Take::sample) of_own += both;
    while (reports.take(report) == Take::sample) aged += report.peer_age_s > 0.0 && report.peer_age_s < 0.02;
  }
  ASSERT_EQ(code, 0) << run.err();
  EXPECT_EQ(run.err().find("incompatible"), std::string::npos) << run.err();
  EXPECT_GT(of_shared, 100);
  EXPECT_GT(of_own, 2 * of_shared) << "all states are sent to all";
  EXPECT_GT(aged, 50) << "user 0 does not hear the device of user 1";
}

INSTANTIATE_TEST_SUITE_P(Vendors, SharedStates, ::testing::Values("fastdds", "cyclonedds"));

}  // namespace
}  // namespace subworld::test
