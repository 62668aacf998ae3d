// Reads a topic of a running simulation, with either vendor of DDS, without taking part in it: once a second it prints
// the rate and the size of the forces that leave for a device.
#include "model/error.hpp"
#include "wire/observer.hpp"

#include <fmt/core.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <thread>

using namespace subworld;

static void watch(Watched<DeviceCommand>& commands, int seconds) {
  using Clock = std::chrono::steady_clock;
  DeviceCommand command;
  for (auto until = Clock::now() + std::chrono::seconds(1); seconds > 0 && !command.last; --seconds) {
    int count = 0;
    double square_n2 = 0.0;
    for (; Clock::now() < until; std::this_thread::sleep_for(std::chrono::milliseconds(1))) {
      for (; commands.take(command); ++count) square_n2 += command.wrench.force.squaredNorm();
    }
    until += std::chrono::seconds(1);
    fmt::print("{:.3f} s: {} Hz, force rms {:.3f} N\n", command.stamp_s, count,
               std::sqrt(square_n2 / std::max(count, 1)));
    std::fflush(stdout);
  }
}

int main(int argc, char** argv) try {
  if (argc != 5) throw Error(ExitCode::usage, "usage: read_forces fastdds|cyclonedds DOMAIN USER SECONDS");
  BusConfig config;
  config.vendor = parse_vendor(argv[1]);
  config.domain = std::atoi(argv[2]);
  config.mode = Mode::realtime;
  config.participant_name = "read_forces";
  const auto bus = open_bus(config);
  Watched<DeviceCommand> commands(*bus, device_partition(std::atoi(argv[3])));
  watch(commands, std::atoi(argv[4]));
} catch (const Error& error) {
  fmt::print(stderr, "{}\n", error.what());
  return static_cast<int>(error.code());
}
