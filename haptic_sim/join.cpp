#include "haptic_sim/run.hpp"
#include "model/error.hpp"
#include "rt/stop.hpp"

#include <fmt/format.h>

namespace subworld {

namespace {

/// Waits until `there` is true; false when asked to stop.
template <class Condition>
bool wait_for(Bus& bus, double timeout_s, Condition there, const std::string& missing) {
  const TimePoint until = Clock::now() + from_seconds(timeout_s);
  while (!there()) {
    if (stop_signal() != 0) return false;
    if (Clock::now() > until) throw Error(ExitCode::failed, missing);
    bus.wait(0.05);
  }
  return true;
}

}  // namespace

std::optional<FirstFrame> join(HapticPorts& ports, SubWorld& sub, const Scene& scene, const Options& options) {
  ports.status.enter("waiting");
  const auto missing = [&](const char* what, const char* program) {
    return fmt::format("no {} on domain {} within {} s; start {} on the same domain, or name its host with --peers",
                       what, options.network.domain, options.wait_s, program);
  };

  SceneDescription description;
  const bool described = wait_for(
      *ports.bus, options.wait_s, [&] { return ports.scene.take(description) == Take::sample; },
      missing("world", "world_sim"));
  if (!described) return std::nullopt;
  if (description.settings_hash != settings_hash(scene)) {
    throw Error(ExitCode::usage,
                fmt::format("{}: the world on domain {} runs scene \"{}\" with other settings; give both programs the "
                            "same file and the same flags",
                            options.scene, options.network.domain, description.name));
  }
  const bool held = wait_for(
      *ports.bus, options.wait_s, [&] { return ports.device.matched() > 0 && ports.command.matched() > 0; },
      missing("device", fmt::format("device_sim --user {}", options.user).c_str()));
  if (!held) return std::nullopt;

  FirstFrame first;
  const bool framed = wait_for(
      *ports.bus, options.wait_s, [&] { return ports.frames.take(first.frame) == Take::sample; },
      missing("frame of the world", "every user's haptic_sim and device_sim"));
  if (!framed) return std::nullopt;
  first.received = Clock::now();
  sub.apply(first.frame);
  ports.status.enter("running");
  return first;
}

}  // namespace subworld
