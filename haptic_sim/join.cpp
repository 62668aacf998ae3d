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

constexpr auto kNothingComing = [] { return false; };

}  // namespace

std::optional<FirstFrame> join(HapticPorts& ports, SubWorld& sub, const Scene& scene, const Options& options) {
  ports.status.enter("waiting");
  const auto missing = [&](const char* what, const char* program) {
    return fmt::format(
        "no {} on domain {} within {} s; start {} with the same --domain; on another host, name it with "
        "--peers and give --interface on both",
        what, options.network.domain, options.wait_s, program);
  };

  SessionFinder finder(ports.scene, settings_hash(scene));
  const auto found = [&] { return finder.look(options.scene, options.network.domain); };
  // A big world takes its time, and says every second that it is there.
  const auto world_is_there = [&] { return ports.status.hears(ProgramKind::world_sim, 0); };
  if (!wait_for(*ports.bus, options.wait_s, found, world_is_there, missing("world", "world_sim"))) return std::nullopt;
  const bool held = wait_for(
      *ports.bus, options.wait_s, [&] { return ports.device.matched() > 0 && ports.command.matched() > 0; },
      kNothingComing, missing("device", fmt::format("device_sim --user {}", options.user).c_str()));
  if (!held) return std::nullopt;
  // A device that has matched may still look for the world: it would miss a short run, and wait for ever. In lock-step
  // its first state is the first step's, and is waited for there.
  DeviceState state;
  const auto runs = [&] {
    while (ports.device.take(state) == Take::sample) {
      if (found() && state.session == finder.session()) return true;
    }
    return false;
  };
  const bool served =
      scene.settings.mode == Mode::lockstep ||
      wait_for(*ports.bus, options.wait_s, runs, kNothingComing,
               missing("running device", fmt::format("device_sim --user {} anew", options.user).c_str()));
  if (!served) return std::nullopt;

  FirstFrame first;
  bool joined = false;
  // The world stands until it has heard everybody; a standing frame is answered, each time, for the answer may be lost.
  const auto started = [&] {
    found();  // the newest world counts
    ports.session = finder.session();
    while (ports.frames.take(first.frame) == Take::sample) {
      if (first.frame.session != ports.session) continue;
      if (ports.refused_by(first.frame))
        throw Error(ExitCode::failed, refused_text(static_cast<std::uint32_t>(sub.user())));
      first.received = Clock::now();
      if (!joined) joined = sub.reset_from(first.frame);
      if (joined) ports.frames.trust_sender();
      if (!joined) continue;  // not answered: a standing world tells again
      if (first.frame.real_time_factor > 0.0) return true;
      ports.send(sub.report(to_ns(first.received)));
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
