// A foreign writer that sends harmful samples into a run: hostile_peer VENDOR DOMAIN MODE KIND [SECONDS]
// It uses the run's session and the identities of its programs. The kind `scene_flood` begins before the run.
// hostile_peer VENDOR DOMAIN lockstep as_device SECONDS KEYS PROGRAM sends states as the device of user 0, with the
// keys of a program, or without any.
#include "wire/bus.hpp"
#include "wire/session.hpp"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>

namespace subworld::test {
namespace {

using namespace std::chrono_literals;

/// Data of a run that a foreign writer can receive.
struct Overheard {
  SceneDescription scene;
  WorldFrame frame;
  DeviceState state;
  DeviceCommand command;
  HapticReport report;
};

constexpr double kHuge = 1.7e9;

struct Attack {
  explicit Attack(Bus& bus)
      : frames(bus.writer<WorldFrame>(user_partition(0))),
        reports(bus.writer<HapticReport>(user_partition(0))),
        states(bus.writer<DeviceState>(device_partition(0))),
        commands(bus.writer<DeviceCommand>(device_partition(0))),
        scenes(bus.writer<SceneDescription>()) {}

  void send(const std::string& kind, const Overheard& of, std::uint64_t n) {
    WorldFrame frame = of.frame;
    DeviceState state = of.state;
    DeviceCommand command = of.command;
    HapticReport report = of.report;
    state.sequence += n;
    command.sequence += n;
    if (kind == "old_frame") frame.stamp = 1, frame.stamp_s = 0.004;
    if (kind == "far_frame") frame.stamp += 1'000'000, frame.stamp_s += 4000.0;
    if (kind == "standing_frame") frame.stamp += n, frame.real_time_factor = 0.0;
    if (kind == "last_frame") frame.stamp += n, frame.last = true;
    if (kind == "moved_frame") {
      frame.stamp += n;
      for (StampedBody& body : frame.states) body.state.position += Vec3(0, 0, 1);
    }
    if (kind == "served_frame") frame.served = 7;
    if (kind == "jumping_state") state.pose.position = Vec3(n % 2 == 0 ? 1.0 : 0.0, 0, 0);
    if (kind == "fast_state") state.linear_velocity = Vec3(kHuge, 0, 0);
    if (kind == "pressing_state") state.applied.force = Vec3(kHuge, 0, 0);
    if (kind == "second_device") state.sender = 7;
    if (kind == "old_state") state.sequence = 0, state.stamp_s = 0.0;
    if (kind == "huge_command") command.wrench.force = Vec3(kHuge, 0, 0);
    if (kind == "flipping_command") command.wrench.force = Vec3(n % 2 == 0 ? 40.0 : -40.0, 0, 0);
    if (kind == "last_command") command.last = true;
    if (kind == "far_command") command.pose.position = Vec3(kHuge, 0, 0);
    if (kind == "huge_report") report.impulse_total.force = Vec3(kHuge, 0, 0), report.stamp += n;
    if (kind == "far_report") report.stamp += 1'000'000, report.stamp_s += 4000.0;
    if (kind == "second_haptic") report.sender = 7, report.stamp += n;
    if (kind.ends_with("_frame")) frames.write(frame);
    if (kind.ends_with("_state") || kind == "second_device") states.write(state);
    if (kind.ends_with("_command")) commands.write(command);
    if (kind.ends_with("_report") || kind == "second_haptic") reports.write(report);
    if (kind == "second_world") {
      SceneDescription scene = of.scene;
      scene.session = 7;
      scenes.write(scene);
      frame.session = 7;
      frames.write(frame);
    }
  }

  Writer<WorldFrame> frames;
  Writer<HapticReport> reports;
  Writer<DeviceState> states;
  Writer<DeviceCommand> commands;
  Writer<SceneDescription> scenes;
};

template <class M>
bool listen(Reader<M>& reader, M& sample) {
  bool heard = false;
  while (reader.take(sample) == Take::sample) heard = true;
  return heard;
}

/// Describes a world that is not there, 500 times a second and from the beginning.
int flood(Bus& bus, double seconds) {
  auto scenes = bus.writer<SceneDescription>();
  SceneDescription scene;
  scene.name = "flood";
  scene.session = 7;
  std::printf("attacks\n");
  std::fflush(stdout);
  const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (std::chrono::steady_clock::now() < until) {
    scenes.write(scene);
    std::this_thread::sleep_for(2ms);
  }
  return 0;
}

int pose_as_device(const BusConfig& config, double seconds) {
  const auto bus = open_bus(config);
  auto states = bus->writer<DeviceState>(device_partition(0));
  std::printf("attacks\n");
  std::fflush(stdout);
  DeviceState state;
  state.sender = 666;
  const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (std::chrono::steady_clock::now() < until) {
    ++state.sequence;
    states.write(state);
    std::this_thread::sleep_for(5ms);
  }
  return 0;
}

int attack(const std::string& vendor, int domain, const std::string& mode, const std::string& kind, double seconds) {
  BusConfig config;
  config.vendor = parse_vendor(vendor);
  config.domain = domain;
  config.mode = mode == "realtime" ? Mode::realtime : Mode::lockstep;
  const auto bus = open_bus(config);
  if (kind == "scene_flood") return flood(*bus, seconds);
  Overheard of;
  auto scene = bus->reader<SceneDescription>();
  auto frame = bus->reader<WorldFrame>(user_partition(0));
  auto state = bus->reader<DeviceState>(device_partition(0));
  auto command = bus->reader<DeviceCommand>(device_partition(0));
  auto report = bus->reader<HapticReport>(user_partition(0));
  // Until the run is in progress: the haptic loop has chosen its device.
  const auto runs = [&] {
    return of.frame.real_time_factor > 0.0 && of.state.sender != 0 && of.command.served == of.state.sender;
  };
  for (int heard = 0; heard < 5 || !runs();) {
    heard += listen(scene, of.scene) + listen(frame, of.frame) + listen(state, of.state) + listen(command, of.command) +
             listen(report, of.report);
    std::this_thread::sleep_for(1ms);
  }
  Attack attack(*bus);
  std::printf("attacks\n");
  std::fflush(stdout);
  const auto until = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  for (std::uint64_t n = 1; std::chrono::steady_clock::now() < until; ++n) {
    attack.send(kind, of, n);
    std::this_thread::sleep_for(1ms);
  }
  return 0;
}

}  // namespace
}  // namespace subworld::test

int main(int argc, char** argv) try {
  if (argc < 5) return 2;
  if (argc == 8) {
    subworld::BusConfig config{.vendor = subworld::parse_vendor(argv[1]), .domain = std::atoi(argv[2])};
    config.secure = argv[6];
    config.participant_name = argv[7];
    return subworld::test::pose_as_device(config, std::atof(argv[5]));
  }
  return subworld::test::attack(argv[1], std::atoi(argv[2]), argv[3], argv[4], argc > 5 ? std::atof(argv[5]) : 1.0);
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
