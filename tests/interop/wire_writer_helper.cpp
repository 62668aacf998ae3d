// Writes device states 100 times a second until it is killed: wire_writer_helper VENDOR DOMAIN

#include "wire/bus.hpp"

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>

int main(int argc, char** argv) try {
  if (argc != 3) return 2;
  subworld::BusConfig config;
  config.vendor = subworld::parse_vendor(argv[1]);
  config.domain = std::atoi(argv[2]);
  const auto bus = subworld::open_bus(config);
  auto writer = bus->writer<subworld::DeviceState>();
  subworld::DeviceState state;
  for (;; ++state.sequence) {
    writer.write(state);
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
