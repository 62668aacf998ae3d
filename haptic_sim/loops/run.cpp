#include "haptic_sim/loops/run.hpp"
#include "coupling/schemes/scheme.hpp"
#include "model/error.hpp"
#include "program/engine_orders.hpp"
#include "program/join.hpp"
#include "rt/presence.hpp"

#include <fmt/core.h>

#include <algorithm>

namespace subworld {

std::string HapticRun::follow_orders() const {
  std::string begun;
  Control order;
  while (ports.control.take(order) == Take::sample) {
    const auto wanted = order_for_sub_worlds(order);
    if (!wanted) continue;
    OrderAnswer answer = sub.change_engine(exchange, *wanted);
    if (answer.outcome != OrderState::refused) begun = engine_text(*wanted);
    ports.status.answer(order.number, std::move(answer));
  }
  follow_exchange();
  return begun;
}

void HapticRun::follow_exchange() const {
  if (const auto change = subworld::follow_exchange(sub, exchange, ports.status)) measures.engine_changed(*change);
  if (const auto change = measures.take_settled_change()) {
    ports.status.answer(change->order,
                        {OrderState::done, fmt::format("{}; force steps {:.3f} N, before {:.3f} N", to_text(*change),
                                                       change->force_step_n, change->force_step_before_n)});
  }
}

namespace {

/// The same in real time, once the device is there.
std::optional<FirstFrame> begin_realtime(const HapticRun& run) {
  const auto& [options, scene, ports, sub, measures, exchange, finder] = run;
  FirstFrame first;
  bool joined = false, timed = false;
  TimePoint displaced{};
  const auto usable = [&] {
    if (first.frame.session != ports.session) return false;
    first.received = Clock::now();
    if (!ports.serves_another(first.frame)) return true;
    // One that was killed is served until the world misses its reports.
    if (displaced == TimePoint{}) displaced = first.received;
    if (to_seconds(first.received - displaced) > kGone_s)
      throw Error(ExitCode::failed, displaced_text(ProgramKind::world_sim, 0));
    return false;
  };
  // The world stands until it has heard everybody; a standing frame is answered, each time, for the answer may be lost.
  const auto started = [&] {
    finder.look(options.network.domain);  // the newest world counts
    ports.session = finder.session();
    while (ports.frames.take(first.frame) == Take::sample) {
      if (!usable()) continue;
      if (first.frame.echoed_sent_ns != 0) {
        const double round_trip_s = 1e-9 * static_cast<double>(to_ns(first.received) - first.frame.echoed_sent_ns);
        first.round_trip_s = timed ? std::min(first.round_trip_s, round_trip_s) : round_trip_s;
        timed = true;
      }
      joined = joined || sub.reset_from(first.frame);
      if (!joined) continue;  // not answered: a standing world tells again
      ports.frames.trust_sender();
      if (first.frame.real_time_factor > 0.0) return true;
      ports.send(*sub.close_cycle(to_ns(first.received)));
    }
    return false;
  };
  const auto settles = [&] { return ports.world_lives(); };  // a living world may take its time
  const Wanted frame{"frame of the world", "every user's haptic_sim and device_sim"};
  if (!wait_for(*ports.bus, options, frame, started, settles)) return std::nullopt;
  ports.status.enter("running");
  return first;
}

}  // namespace

std::optional<FirstFrame> join(const HapticRun& run) {
  const auto& [options, scene, ports, sub, measures, exchange, finder] = run;
  ports.status.enter("waiting");
  const auto found = [&] { return finder.look(options.network.domain); };
  // A big world takes its time, and says every second that it is there.
  const auto world_is_there = [&] { return ports.status.hears(ProgramKind::world_sim, 0); };
  if (!wait_for(*ports.bus, options, {"world", "world_sim"}, found, world_is_there)) return std::nullopt;
  const std::string device_sim = fmt::format("device_sim --user {}", options.user);
  const bool lockstep = scene.settings.mode == Mode::lockstep;
  // In lock-step a device must send its status too.
  const auto held = [&] {
    return ports.device.matched() > 0 && ports.command.matched() > 0 &&
           (!lockstep || ports.status.met(ProgramKind::device_sim, run.user()));
  };
  if (!wait_for(*ports.bus, options, {"device", device_sim}, held)) return std::nullopt;
  if (lockstep) return begin_lockstep(run);
  // A device that has matched may still look for the world: it would miss a short run, and wait for ever.
  DeviceState state;
  const auto runs = [&] {
    while (ports.device.take(state) == Take::sample) {
      if (found() && state.session == finder.session()) return true;
    }
    return false;
  };
  if (!wait_for(*ports.bus, options, {"running device", device_sim + " anew"}, runs)) return std::nullopt;
  return begin_realtime(run);
}

}  // namespace subworld
