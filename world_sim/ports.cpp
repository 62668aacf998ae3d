#include "world_sim/ports.hpp"

#include "wire/partitions.hpp"

namespace subworld {

WorldPorts::WorldPorts(const Options& options, const Scene& scene_file)
    : served(static_cast<std::size_t>(scene_file.settings.users), 0),
      bus(open_bus(options.network, scene_file.settings, scene_file.settings.h_s, "world_sim")),
      scene(bus->writer<SceneDescription>()),
      snapshots(bus->writer<WorldSnapshot>()),
      control(bus->reader<Control>()),
      status(*bus, ProgramKind::world_sim, 0, "world_sim") {
  for (int u = 0; u < scene_file.settings.users; ++u) {
    frames.push_back(bus->writer<WorldFrame>(user_partition(u)));
    reports.push_back(bus->reader<HapticReport>(user_partition(u)));
  }
}

bool WorldPorts::accept(std::size_t user, const HapticReport& report) noexcept {
  if (report.session != session) return false;
  if (served[user] == 0) served[user] = report.sender;
  return report.sender == served[user];
}

}  // namespace subworld
