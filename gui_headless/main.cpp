#include "io/options/options.hpp"
#include "io/version.hpp"
#include "live/server.hpp"
#include "model/error.hpp"
#include "picture.hpp"
#include "rt/cyclic.hpp"
#include "rt/stop.hpp"
#include "wire/bus.hpp"
#include "wire/message_memory.hpp"
#include "wire/status.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace subworld {
namespace {

/// All topics of the display process.
struct DisplayPorts {
  DisplayPorts(const Options& options, const Scene& scene_file)
      : bus(open_bus(options.network, scene_file.settings, scene_file.settings.h_s, "gui_headless")),
        scene(bus->reader<SceneDescription>()),
        snapshots(bus->reader<WorldSnapshot>()),
        statuses(bus->reader<Status>()),
        status(*bus, ProgramKind::gui_headless, 0, "gui_headless") {}

  std::unique_ptr<Bus> bus;
  Reader<SceneDescription> scene;
  Reader<WorldSnapshot> snapshots;
  Reader<Status> statuses;
  StatusBeacon status;
};

/// The world as last received.
struct Display {
  SceneDescription scene;
  std::vector<UserView> users;
  std::vector<std::uint32_t> broken_joints;
  double time_s = 0.0;
  std::uint64_t snapshots = 0;

  [[nodiscard]] bool described() const noexcept { return !scene.bodies.empty(); }

  void show(const WorldSnapshot& snapshot) {
    for (const StampedBody& moved : snapshot.moved) {
      if (index(moved.id) < scene.states.size()) scene.states[index(moved.id)] = moved.state;
    }
    users = snapshot.users;
    broken_joints = snapshot.broken_joints;
    time_s = snapshot.stamp_s;
    ++snapshots;
  }
  /// Throws `Error` (failed).
  void write_picture(const std::string& file) const {
    write_png(file, draw({scene.bodies, scene.states, scene.meshes, users, {}, {}, scene.joints, broken_joints}).image,
              kOwnMark);
  }
};

/// Follows the world until it stops. True: a signal has asked this program to end before. Throws `Error` (failed) if no
/// world is found.
bool follow(DisplayPorts& ports, Display& display, live::Server* viewers, const Options& options) {
  ports.status.enter("waiting");
  SceneDescription description;
  WorldSnapshot snapshot;
  Status status;
  TimePoint heard = Clock::now();
  double next_picture_s = options.picture_every_s;
  bool stopping = false, asked = false;
  while (!stopping && !asked) {
    ports.bus->wait(0.1);
    asked = stop_signal() != 0;
    while (ports.statuses.take(status) == Take::sample) {
      if (const auto program = ports.statuses.sender_program(); program && viewers != nullptr)
        viewers->place(status.program, status.instance, *program);
      stopping |= status.program == ProgramKind::world_sim && status.state == "stopping";
    }
    if (ports.scene.take(description) == Take::sample) {
      if (viewers != nullptr) viewers->describe(description);
      display.scene = std::move(description);
      ports.status.enter("running");
    }
    while (display.described() && ports.snapshots.take(snapshot) == Take::sample) display.show(snapshot);
    // Either is a sign of life: on a busy machine a vendor may lose the liveliness of a writer that lives.
    if (ports.scene.alive_writers() > 0 || ports.status.hears(ProgramKind::world_sim, 0)) heard = Clock::now();
    const double absent_s = to_seconds(Clock::now() - heard);
    if (!display.described() && absent_s > options.wait_s) {
      throw Error(ExitCode::failed, fmt::format("no world on domain {} within {} s; start world_sim with the same "
                                                "--domain; on another host, name it with "
                                                "--peers and give --interface on both",
                                                options.network.domain, options.wait_s));
    }
    if (display.described() && absent_s > 1.0) break;
    if (options.picture_every_s > 0.0 && display.snapshots > 0 && display.time_s >= next_picture_s) {
      display.write_picture(fmt::format("{}/picture_{:08.3f}.png", options.out, display.time_s));
      next_picture_s += options.picture_every_s;
    }
    ports.status.update({display.time_s, display.snapshots});
  }
  return asked;
}

/// Empty where viewers are not served. Throws `Error`.
std::unique_ptr<live::Server> serve_viewers(const Options& options, const Scene& scene, Bus& bus) {
  const LiveOptions& wanted = options.live;
  if (!wanted.port) return {};
  auto server = std::make_unique<live::Server>(live::ServerConfig{.address = wanted.address,
                                                                  .port = *wanted.port,
                                                                  .token = wanted.token,
                                                                  .origins = wanted.origins,
                                                                  .name = scene.name,
                                                                  .users = scene.settings.users,
                                                                  .domain = options.network.domain},
                                               bus);
  fmt::print("gui_headless: viewers: open ws://{0} in Lichtblick or Foxglove, http://{0}{1} in a browser\n",
             server->address(), wanted.token.empty() ? "" : "/?token=TOKEN");
  std::fflush(stdout);
  return server;
}

/// Whether a verdict of the run follows. The launcher ends a display with SIGINT where it does.
bool verdict_follows(const char* summary) {
  return summary != nullptr && (stop_signal() == 0 || stop_signal() == SIGINT);
}

/// Passes the verdict of the run on, where viewers wait for it: the launcher writes it when all other programs have
/// ended.
void show_verdict(DisplayPorts& ports, live::Server& viewers, const std::string& summary) {
  constexpr std::chrono::milliseconds kLook{20};
  constexpr double kLongest_s = 5.0;
  end_recording();
  ports.status.enter(kAwaitsVerdict);
  for (const TimePoint begin = Clock::now(); !std::filesystem::exists(summary);) {
    if (to_seconds(Clock::now() - begin) > kLongest_s || !viewers.verdict_is_awaited()) return;
    std::this_thread::sleep_for(kLook);
  }
  viewers.show_verdict(summary);
}

}  // namespace
}  // namespace subworld

int main(int argc, char** argv) {
  using namespace subworld;
  return run_program(Program::gui_headless, argc, argv, [](const Options& options, const Scene& scene) {
    [[maybe_unused]] const int niceness = nice(5);  // the display may wait for the loops that compute forces

    Display display;
    const char* const verdict = std::getenv(kVerdictVariable);
    watch_stop_signals(verdict == nullptr ? kLongestEnd_s : 0.0);  // the launcher may take longer to judge
    DisplayPorts ports(options, scene);
    fmt::print("gui_headless: {}\n", ports.bus->effective_settings());
    auto viewers = serve_viewers(options, scene, *ports.bus);
    const bool asked = follow(ports, display, viewers.get(), options);
    ports.status.enter("stopping");
    if (viewers) viewers->end_run();
    if (viewers && (!verdict_follows(verdict) || !viewers->verdict_is_awaited())) viewers.reset();
    if (display.snapshots > 0) {
      const std::string file = options.out + "/picture.png";
      display.write_picture(file);
      fmt::print("gui_headless: picture at t = {:.3f} s in {}\n", display.time_s, file);
    } else if (!asked) {
      throw Error(ExitCode::failed,
                  "no picture: the world ended before it sent a state; start the display before the world, and the "
                  "world with --await-display");
    }
    if (viewers) show_verdict(ports, *viewers, verdict);
  });
}
