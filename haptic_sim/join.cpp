#include "haptic_sim/run.hpp"
#include "model/error.hpp"
#include "rt/stop.hpp"

#include <fmt/format.h>

namespace subworld {

namespace {

/// Waits until `there` is true, for `timeout_s` since `coming` last held; false when asked to stop.
template <class There, class Coming>
bool wait_for(Bus& bus, double timeout_s, There there, Coming coming, const std::string& missing) {
  TimePoint hope = Clock::now();
  while (!there()) {
    if (stop_signal() != 0) return false;
    if (coming()) hope = Clock::now();
    if (to_seconds(Clock::now() - hope) > timeout_s) throw Error(ExitCode::failed, missing);
    bus.wait(0.05);
  }
  return true;
}

constexpr double kMayBeEnding_s = 2.0;  ///< a world of another run, of which the last has just been heard

constexpr auto kNothingComing = [] { return false; };

}  // namespace

std::optional<FirstFrame> join(HapticPorts& ports, SubWorld& sub, const Scene& scene, const Options& options) {
  ports.status.enter("waiting");
  const auto missing = [&](const char* what, const char* program) {
    return fmt::format("no {} on domain {} within {} s; start {} on the same domain, or name its host with --peers",
                       what, options.network.domain, options.wait_s, program);
  };

  SceneDescription description;
  std::optional<TimePoint> other;  // when a world with other settings was first heard
  const auto ours_or_none = [&] {
    while (ports.scene.take(description) == Take::sample) {
      if (description.settings_hash == settings_hash(scene)) return true;
      if (!other) other = Clock::now();
    }
    return other && to_seconds(Clock::now() - *other) > kMayBeEnding_s;
  };
  // A big world takes its time: it says every second that it is being created.
  auto statuses = ports.bus->reader<Status>();
  Status status;
  const auto world_is_made = [&] {
    bool made = false;
    while (statuses.take(status) == Take::sample)
      made |= status.program == ProgramKind::world_sim && (status.state == "loading" || status.state == "settling");
    return made;
  };
  const bool described =
      wait_for(*ports.bus, options.wait_s, ours_or_none, world_is_made, missing("world", "world_sim"));
  if (!described) return std::nullopt;
  if (description.settings_hash != settings_hash(scene)) {
    throw Error(ExitCode::usage,
                fmt::format("{}: the world on domain {} runs scene \"{}\" with other settings; give both programs the "
                            "same file and the same flags",
                            options.scene, options.network.domain, description.name));
  }
  const bool held = wait_for(
      *ports.bus, options.wait_s, [&] { return ports.device.matched() > 0 && ports.command.matched() > 0; },
      kNothingComing, missing("device", fmt::format("device_sim --user {}", options.user).c_str()));
  if (!held) return std::nullopt;

  FirstFrame first;
  bool joined = false;
  // The world stands until it has heard everybody; a standing frame is answered, each time, for the answer may be lost.
  const auto started = [&] {
    while (ports.frames.take(first.frame) == Take::sample) {
      first.received = Clock::now();
      if (!joined) joined = sub.adopt(first.frame);
      if (!joined) continue;  // not answered: a standing world tells again
      if (first.frame.clock_factor > 0.0) return true;
      ports.reports.write(sub.report(to_ns(first.received)));
    }
    return false;
  };
  const bool framed = wait_for(
      *ports.bus, options.wait_s, started,
      [&] { return ports.scene.alive_writers() > 0; },  // a living world may take its time to settle
      missing("frame of the world", "every user's haptic_sim and device_sim"));
  if (!framed) return std::nullopt;
  ports.status.enter("running");
  return first;
}

}  // namespace subworld
