#include "world_sim/ports.hpp"

#include "wire/partitions.hpp"

#include <fmt/format.h>

namespace subworld {

WorldPorts::WorldPorts(const Options& options, const Scene& scene_file)
    : domain(options.network.domain),
      served(static_cast<std::size_t>(scene_file.settings.users), 0),
      bus(open_bus(options.network, scene_file.settings, scene_file.settings.h_s, "world_sim")),
      scene(bus->writer<SceneDescription>()),
      worlds(bus->reader<SceneDescription>()),
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
  if (served[user] == 0) {
    served[user] = report.sender;
    reports[user].trust_sender();
  }
  return report.sender == served[user];
}

WorldRefused WorldPorts::refused() const {
  std::uint64_t sent = 0;
  for (const auto& reader : reports) sent += reader.refused();
  return {.haptic_report = sent, .scene = second_worlds_};
}

std::string WorldPorts::second_world() {
  while (worlds.take(heard_scene_) == Take::sample) {
    if (heard_scene_.session == session) continue;
    ++second_worlds_;
    return fmt::format(
        "two world_sim are on domain {}, this one and one of scene \"{}\": end one of them, or give it another "
        "--domain",
        domain, heard_scene_.name);
  }
  return {};
}

}  // namespace subworld
