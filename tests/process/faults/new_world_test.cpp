// A sub-world and a world that takes the place of one that has died.
#include "process/process_test.hpp"
#include "rt/cyclic.hpp"
#include "world_sim/loops/ports.hpp"
#include "world_sim/world.hpp"

namespace subworld::test {
namespace {

/// The world's side of a run of `press`, as far as messages go; haptic_sim and device_sim are the real programs.
class NewWorld : public ProcessTest {
 protected:
  [[nodiscard]] Options options() const {
    Options options;
    options.scene = scene("press");
    change(options, "mode", "realtime");
    options.network.domain = domain_.number();
    return options;
  }
  void publish(WorldPorts& ports, double start_in_s, double real_time_factor, bool last = false) {
    WorldFrame& frame = world_.frame(0);
    frame.session = ports.session;
    frame.served = ports.served[0];
    frame.start_in_s = start_in_s;
    frame.real_time_factor = real_time_factor;
    frame.last = last;
    ports.frames[0].write(frame);
  }
  /// Number of reports to this world.
  int reports(WorldPorts& ports) {
    int count = 0;
    while (ports.reports[0].take(report_) == Take::sample) {
      if (!ports.belongs(0, report_)) continue;
      ports.serve(0, report_.sender);
      ++count;
    }
    return count;
  }
  /// Whether a report answers a frame of a world that stands.
  bool answered(WorldPorts& ports) {
    return eventually([&] {
      publish(ports, 0.0, 0.0);
      ports.bus->wait(0.04);
      return reports(ports) > 0;
    });
  }

  const Scene scene_ = load_scene(options());
  World world_{scene_};
  HapticReport report_;
};

TEST_F(NewWorld, GetsNoReportBeforeItsFirstFrame) {
  ASSERT_TRUE(world_.settle([](double) { return true; }));
  WorldPorts first(options(), scene_), second(options(), scene_);
  first.describe(scene_, world_.engine());
  first.status.enter("waiting");
  second.status.enter("loading");
  const auto start = [&](const std::string& name) {
    std::filesystem::create_directories(folder_.path() + "/" + name);
    return Process({program(name), scene("press"), "--mode", "realtime", "--domain", domain_.text()},
                   folder_.path() + "/" + name);
  };
  Process haptic = start("haptic_sim"), device = start("device_sim");
  ASSERT_TRUE(answered(first)) << haptic.err();
  // The first world dies after the first frame of a clock that runs. The sub-world runs for a while without frames, and
  // longest where the clock begins late. By then the second world is known.
  constexpr double kStartIn_s = 0.7;
  publish(first, kStartIn_s, 1.0);
  second.describe(scene_, world_.engine());
  int to_first = 0, to_second = 0;
  for (const TimePoint until = Clock::now() + from_seconds(kStartIn_s + 1.0); Clock::now() < until;) {
    first.bus->wait(0.01);
    to_first += reports(first);
    to_second += reports(second);
  }
  EXPECT_GT(to_first, 10) << "the sub-world has not run: " << haptic.err();
  EXPECT_EQ(to_second, 0) << "of a sub-world that has no state of this world";
  EXPECT_TRUE(answered(second)) << haptic.err();
  publish(second, 0.0, 1.0, true);
  EXPECT_EQ(haptic.wait(), 0) << haptic.err();
  EXPECT_EQ(device.wait(), 0) << device.err();
}

}  // namespace
}  // namespace subworld::test
