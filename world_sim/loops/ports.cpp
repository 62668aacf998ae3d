#include "world_sim/loops/ports.hpp"

#include "model/joined.hpp"

#include <fmt/core.h>

#include <algorithm>

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

void WorldPorts::describe(const Scene& scene_file, const Engine& engine) {
  SceneDescription description{.name = scene_file.name,
                               .settings = agreed_settings(scene_file),
                               .session = session,
                               .users = static_cast<std::uint32_t>(frames.size()),
                               .meshes = scene_file.meshes,
                               .bodies = scene_file.bodies,
                               .states = {},
                               .joints = scene_file.joints};
  for (const Body& body : scene_file.bodies) {
    const BodyState& initial = scene_file.initial[index(body.id)];
    description.states.push_back(engine.contains(body.id) ? engine.state(body.id) : initial);
  }
  scene.write(description);
}

void WorldPorts::serve(std::size_t user, std::uint64_t sender) noexcept {
  if (served[user] != 0) return;
  served[user] = sender;
  reports[user].trust_sender();
}

void WorldPorts::release(std::size_t user) noexcept {
  served[user] = 0;
  reports[user].distrust();
}

WorldRefused WorldPorts::refused() const {
  std::uint64_t sent = 0;
  for (const auto& reader : reports) sent += reader.refused();
  std::set<std::string> by = scene_writers_;
  for (const auto& reader : reports) by.insert(reader.foreign_programs());
  by.erase("");
  return {.haptic_report = sent, .scene = second_worlds_, .by = joined(by, "; ")};
}

std::string WorldPorts::second_world() {
  constexpr std::size_t kMostUnknown = 256, kMostNamed = 4;
  while (worlds.take(heard_scene_) == Take::sample) {
    if (heard_scene_.session == session) continue;
    ++second_worlds_;
    const std::uint64_t participant = worlds.sender_participant();
    const auto known = std::ranges::find(unknown_scenes_, participant, &UnknownScene::participant);
    if (known != unknown_scenes_.end() || unknown_scenes_.size() >= kMostUnknown) continue;
    unknown_scenes_.push_back({participant, heard_scene_.name});
    if (const auto writer = worlds.sender_program(); writer && scene_writers_.size() < kMostNamed)
      scene_writers_.insert(to_text(*writer));
  }
  const auto world = std::ranges::find_if(unknown_scenes_, [&](const UnknownScene& one) {
    return status.is_program(ProgramKind::world_sim, one.participant);
  });
  if (world == unknown_scenes_.end()) return {};
  const std::string name = world->name;
  unknown_scenes_.erase(world);
  ++other_worlds_;
  return fmt::format(
      "two world_sim are on domain {}, this one and one of scene \"{}\": end one of them, or give it another "
      "--domain",
      domain, name);
}

}  // namespace subworld
