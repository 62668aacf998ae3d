// A peer for tests that works until it is killed: wire_peer VENDOR DOMAIN [MODE INTERFACE PEER...]
// 100 times a second it writes a device state and a report, numbered from 0. They carry the newest command and frame
// that it has received, and how many of their writers are alive.

#include "wire/bus.hpp"

#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <thread>

int main(int argc, char** argv) try {
  if (argc < 3) return 2;
  subworld::BusConfig config;
  config.vendor = subworld::parse_vendor(argv[1]);
  config.domain = std::atoi(argv[2]);
  if (argc > 3 && std::string_view(argv[3]) == "realtime") config.mode = subworld::Mode::realtime;
  config.device_period_s = config.cycle_s = 0.01;
  if (argc > 4) config.interface_address = argv[4];
  for (int i = 5; i < argc; ++i) config.peers.emplace_back(argv[i]);
  const auto bus = subworld::open_bus(config);
  auto states = bus->writer<subworld::DeviceState>();
  auto reports = bus->writer<subworld::HapticReport>();
  auto commands = bus->reader<subworld::DeviceCommand>();
  auto frames = bus->reader<subworld::WorldFrame>();
  subworld::DeviceState state;
  subworld::HapticReport report;
  report.session = static_cast<std::uint64_t>(getpid());
  subworld::DeviceCommand command;
  subworld::WorldFrame frame;
  for (;; ++state.sequence) {
    while (commands.take(command) == subworld::Take::sample) state.stamp_s = static_cast<double>(command.sequence);
    while (frames.take(frame) == subworld::Take::sample) report.confirmed_stamp = frame.stamp;
    state.buttons = static_cast<std::uint32_t>(commands.alive_writers() + frames.alive_writers());
    report.stamp = state.sequence;
    states.write(state);
    reports.write(report);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
