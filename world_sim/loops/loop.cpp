#include "world_sim/loops/loop.hpp"

#include "model/error.hpp"
#include "model/joined.hpp"
#include "program/engine_orders.hpp"
#include "program/join.hpp"
#include "program/leave.hpp"
#include "rt/stop.hpp"
#include "wire/await.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <utility>

namespace subworld {

std::vector<bool> awaited_users(const Options& options, const Scene& scene, const std::vector<Absence>& absences) {
  const auto users = static_cast<std::size_t>(scene.settings.users);
  std::vector<bool> awaited(users, true), stays(users, true);
  for (std::size_t u = 0; u < users; ++u)
    awaited[u] = stays[u] = takes_part(scene.settings.presence, static_cast<int>(u), 0.0);
  for (const Absence& one : absences) {
    if (one.to_s != WorldMeasures::kNotBack_s || one.user >= users) continue;
    awaited[one.user] = false;
    if (one.by_order) stays[one.user] = false;
  }
  // A world that was started again has the flags of the first: meanwhile these users may have joined.
  const bool again = !options.resume.empty() && options.resume == options.out;
  for (const int user : options.without) {
    if (!again) awaited[static_cast<std::size_t>(user)] = stays[static_cast<std::size_t>(user)] = false;
  }
  return std::ranges::find(awaited, true) != awaited.end() ? awaited : stays;
}

bool await_peers(WorldPorts& ports, const Options& options, const std::vector<bool>& awaited) {
  ports.status.enter("waiting");
  const TimePoint until = Clock::now() + from_seconds(options.wait_s);
  for (std::size_t u = 0; u < ports.frames.size(); ++u) {
    if (!awaited[u]) continue;
    const Wanted haptic{fmt::format("haptic_sim for user {}", u), fmt::format("haptic_sim --user {}", u)};
    const auto there = [&] {
      return ports.frames[u].matched() > 0 && ports.reports[u].matched() > 0 &&
             ports.status.met(ProgramKind::haptic_sim, static_cast<std::uint32_t>(u));
    };
    if (!wait_for(*ports.bus, options, haptic, there)) return false;
  }
  if (options.await_display) {
    // What only looks may hold up a run, but does not end it.
    const auto looks = [&] { return ports.snapshots.matched() > 0; };
    const auto may_wait = [&] { return stop_signal() == 0 && Clock::now() < until; };
    while (!looks() && may_wait()) ports.bus->wait(0.05);
    if (!looks()) ports.status.note("no display has come: the run goes on without one");
    // One that holds the scene has found this world's other topics too; one that has died never will.
    while (looks() && may_wait() && !ports.scene.wait_for_acknowledgments(0.1)) {
    }
    if (stop_signal() != 0) return false;
  }
  // A process that has found the others' endpoints by now has found another world's too.
  if (const std::string text = ports.second_world(); !text.empty()) throw Error(ExitCode::usage, text);
  ports.status.enter("running");
  return true;
}

WorldLoop::WorldLoop(const WorldRun& run)
    : WorldRun(run),
      stages_(measures.stages()),
      scheme_(scheme_of(scene.settings).properties),
      from_s_(world.facts().time_s),
      farewells_(ports.frames.size(), 0) {
  reserve(report_, kUsualMembers);
}

void WorldLoop::follow_orders() {
  if (const std::string text = ports.second_world(); !text.empty()) ports.status.note(text);
  Control order;
  while (ports.control.take(order) == Take::sample) {
    if (!order_for_sub_worlds(order)) ports.status.answer(order.number, follow(order));
  }
  follow_exchange();
}

OrderAnswer WorldLoop::follow(const Control& order) {
  using Kind = PresenceEvent::Kind;
  const auto record = [&](Kind kind, const std::string& text) {
    events_.push_back({.kind = kind, .user = kWorld, .at_s = world.facts().time_s, .order = text});
  };
  if (order.verb == ControlVerb::leave) return dismiss(order.argument);
  if (order.verb == ControlVerb::set_ratio) {
    OrderAnswer answer = world.change_ratio(order.argument);
    if (answer.outcome != OrderState::refused) record(Kind::ratio, order.argument);
    return answer;
  }
  if (order.verb == ControlVerb::set_engine) {
    const auto wanted = parse_engine_order(order);
    if (!wanted) return {OrderState::refused, "unknown engine order \"" + order.argument + "\""};
    OrderAnswer answer = world.change_engine(exchange, *wanted);
    if (answer.outcome != OrderState::refused) record(Kind::engine, engine_text(*wanted));
    return answer;
  }
  OrderAnswer answer = control_.follow(order);
  ports.status.pause(control_.paused());
  return answer;
}

void WorldLoop::follow_exchange() {
  const auto change = subworld::follow_exchange(world, exchange, ports.status);
  if (!change) return;
  measures.engine_changed(*change);
  ports.status.answer(change->order, {OrderState::done, to_text(*change)});
}

OrderAnswer WorldLoop::dismiss(const std::string& number) {
  constexpr double kFarewell_s = 0.5;
  std::size_t user = user_count();
  std::from_chars(number.data(), number.data() + number.size(), user);
  if (user >= user_count())
    return {OrderState::refused, fmt::format("there is no user {}; the run has {}", number, user_count())};
  if (world.user_facts(user).absent) return {OrderState::refused, fmt::format("user {} is absent already", user)};
  // In lock-step no message gets lost.
  const bool lockstep = scene.settings.mode == Mode::lockstep;
  farewells_[user] = lockstep ? 1 : static_cast<int>(std::ceil(kFarewell_s / scene.settings.shortest_cycle_s()));
  return {OrderState::done, fmt::format("user {} leaves at t = {:.3f} s", user, world.facts().time_s)};
}

void WorldLoop::publish_frame(std::size_t user, bool last, double start_in_s, double real_time_factor) {
  const UserFacts facts = world.user_facts(user);
  if (!last && !facts.waits_for_frame) return;
  WorldFrame& frame = world.frame(user);
  frame.newest_stamp = facts.newest_stamp;
  frame.session = ports.session;
  frame.served = ports.served[user];
  frame.last = last;
  frame.start_in_s = start_in_s;
  frame.real_time_factor = real_time_factor;
  const bool sent = ports.frames[user].write(frame);
  // In lock-step the user would wait for it for ever.
  if (sent || last || frame.served == 0 || scene.settings.mode != Mode::lockstep) return;
  const Peer haptic{ProgramKind::haptic_sim, static_cast<std::uint32_t>(user)};
  throw Error(ExitCode::failed, unsent_text("world_frame", ports.reports[user], ports.status, haptic));
}

void WorldLoop::publish_frames(bool last, double start_in_s, double real_time_factor) {
  for (std::size_t u = 0; u < user_count(); ++u) {
    publish_frame(u, last || dismisses(u), start_in_s, real_time_factor);
    if (dismisses(u)) --farewells_[u];
  }
}

std::string WorldLoop::absent_at_end() const {
  std::vector<std::string> texts;
  for (std::size_t u = 0; u < user_count(); ++u) {
    if (!world.user_facts(u).absent || measures.has_left(u)) continue;
    const std::string why = ports.status.gone_text(ProgramKind::haptic_sim, static_cast<std::uint32_t>(u));
    texts.push_back(fmt::format("{}; user {} is absent from t = {:.3f} s on", why, u, measures.absent_from_s(u)));
  }
  return joined(texts, "; ");
}

void WorldLoop::end_cycle() {
  stages_.mark(WorldStage::display);
  measures.end_cycle();
  if (world.facts().finite) return;
  throw Error(ExitCode::failed,
              fmt::format("the world is no longer finite at t = {:.3f} s; use a smaller step or the preset quality",
                          world.facts().time_s));
}

void WorldLoop::close() {
  world.close();
  // A sub-world in lock-step fails without its last frame.
  const double longest_s = scene.settings.mode == Mode::lockstep ? kArrives_s : kArrivesSoon_s;
  const TimePoint begin = Clock::now();
  for (std::uint32_t u = 0; u < user_count(); ++u)
    await_arrival(ports.frames[u], ports.status, {ProgramKind::haptic_sim, u}, begin, longest_s);
}

Ending WorldLoop::ending() const {
  return {.session = ports.session,
          .from_s = from_s_,
          .to_s = world.facts().time_s,
          .by = world.facts().over   ? "duration"
                : control_.stopped() ? control_.stopped_by()
                                     : name_of_signal(stop_signal())};
}

}  // namespace subworld
