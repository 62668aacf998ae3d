#include "display.hpp"

namespace subworld {

DisplayPorts::DisplayPorts(const Options& options, const Scene& scene_file)
    : bus(open_bus(options.network, scene_file.settings, scene_file.settings.h_s, "gui_headless")),
      scene(bus->reader<SceneDescription>()),
      snapshots(bus->reader<WorldSnapshot>()),
      statuses(bus->reader<Status>()),
      status(*bus, ProgramKind::gui_headless, 0, "gui_headless") {}

void Display::describe(SceneDescription&& description) { scene_ = std::move(description); }

void Display::show(const WorldSnapshot& snapshot) {
  for (const StampedBody& moved : snapshot.moved) {
    if (index(moved.id) < scene_.states.size()) scene_.states[index(moved.id)] = moved.state;
  }
  users_ = snapshot.users;
  time_s_ = snapshot.stamp_s;
  ++snapshots_;
}

void Display::write_picture(const std::string& file) {
  if (!renderer_) renderer_ = std::make_unique<Renderer>();
  const Drawing drawing = renderer_->draw({.bodies = scene_.bodies,
                                           .states = scene_.states,
                                           .meshes = scene_.meshes,
                                           .users = users_,
                                           .camera = {},
                                           .line_m_per_n_s = {}});
  write_png(file, drawing.image);
}

}  // namespace subworld
