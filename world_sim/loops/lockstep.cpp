#include "coupling/messages/delay.hpp"
#include "model/error.hpp"
#include "program/engine_orders.hpp"
#include "rt/stop.hpp"
#include "wire/await.hpp"
#include "world_sim/loops/loop.hpp"
#include "world_sim/loops/snapshots.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

namespace subworld {

namespace {

constexpr double kLastReport_s = 0.3;  ///< that a report may take after the world was asked to stop
constexpr double kAgain_s = 0.05;      ///< between two frames that ask for somebody who wants to take part
constexpr double kNamed_s = 2.0;       ///< after which the status names who is waited for
constexpr double kDiscovery_s = 5.0;   ///< within which a program that has been started finds the world
constexpr double kNewcomer_s = 20.0;   ///< that it may take to end, once it has

/// The world process in lock-step.
class LockstepLoop : WorldLoop {
 public:
  explicit LockstepLoop(const WorldRun& run) : WorldLoop(run), snapshots_(ports.snapshots) {
    for (std::uint32_t u = 0; u < user_count(); ++u)
      users_.push_back({.delay = Delay(scene.settings, scheme_.lead_cycles, u)});
  }

  Ending run() {
    for (std::size_t u = 0; u < user_count(); ++u) {
      if (is_planned(u)) continue;
      world.begin_without(u);
      measures.leaves(u, 0.0, true);
    }
    check_plan();
    stages_.begin();
    for (bool last = false; !last;) {
      if (!follow_presence() || !receive_due()) {
        publish(true);
        break;
      }
      if (world.facts().stamp == 0) measures.bodies().record_now(world);
      wait_while_paused();
      last = step();
    }
    measures.bodies().record_now(world);
    if (scheme_.has_sub_worlds) receive_due();
    close();
    await_newcomers();
    record_never_present();
    measures.took_part(events_);
    Ending ended = ending();
    ended.fault = absent_at_end();
    return ended;
  }

 private:
  /// To all who take part. Those who do not get the last frame only: they may be waiting.
  void publish(bool last) {
    for (std::size_t u = 0; u < user_count(); ++u) {
      if (users_[u].present || last) publish_frame(u, last, 0.0, 1.0);
    }
  }

  [[nodiscard]] bool is_planned(std::size_t user) const {
    return takes_part(scene.settings.presence, static_cast<int>(user), world.facts().time_s + 0.5 * scene.settings.h_s);
  }

  /// Who leaves and who joins at this stamp. False when asked to stop.
  bool follow_presence() {
    for (std::size_t u = 0; u < user_count(); ++u) {
      User& user = users_[u];
      const bool planned = is_planned(u);
      if (user.present && (!planned || dismisses(u))) {
        publish_frame(u, true, 0.0, 1.0);
        leave(u, "");
      } else if (!user.present && planned) {
        const bool asks = !user.lost && !user.dismissed;  // the plan, or the start
        if (!look_for(u, asks || (user.lost && scene.settings.absent == Absent::wait))) return false;
      }
      user.dismissed = user.dismissed && planned;
    }
    return true;
  }

  /// `why`: of a user whose programs have fallen silent; empty: by order, or as planned.
  void leave(std::size_t u, const std::string& why) {
    User& user = users_[u];
    const double now_s = world.facts().time_s;
    user.present = false;
    user.lost = !why.empty();
    user.dismissed = why.empty() && is_planned(u);
    user.former = ports.served[u];
    farewells_[u] = 0;
    world.leave(u);
    ports.release(u);
    measures.leaves(u, now_s, why.empty());
    record(events_, PresenceEvent::Kind::leaves, static_cast<int>(u), now_s);
    ports.status.note(why.empty() ? fmt::format("user {} has left at t = {:.3f} s", u, now_s)
                                  : fmt::format("{}; user {} is absent from t = {:.3f} s on, and the world holds its "
                                                "proxy",
                                                why, u, now_s));
  }

  /// Begins with the next program that wants to take part for the user; `waits`: until there is one. False when asked
  /// to stop.
  bool look_for(std::size_t u, bool waits) {
    User& user = users_[u];
    const TimePoint begin = Clock::now();
    bool said = false;
    while (true) {
      if (Clock::now() >= user.asks_at) {
        publish_frame(u, false, 0.0, 0.0);
        user.asks_at = Clock::now() + from_seconds(kAgain_s);
      }
      while (ports.reports[u].take(report_) == Take::sample) {
        const bool ours = report_.session == ports.session && report_.sender != user.former;
        if (!ours || !asks_to_take_part(report_)) continue;
        join(u);
        if (said) ports.status.note(fmt::format("haptic_sim {} takes part", u), "");
        return true;
      }
      if (!waits) return true;
      if (gives_up_at_signal() || control_.stopped()) return false;
      if (to_seconds(Clock::now() - begin) > options.wait_s) {
        throw Error(ExitCode::failed,
                    fmt::format("nobody takes part for user {} within {} s; start haptic_sim --user {} and device_sim "
                                "--user {}, or give a longer --wait",
                                u, options.wait_s, u, u));
      }
      if (waits && !said && to_seconds(Clock::now() - begin) > kNamed_s) {
        said = true;
        ports.status.note(fmt::format("waits for haptic_sim {0}: its request to take part from t = {1:.3f} s on", u,
                                      world.facts().time_s),
                          label_of(ProgramKind::haptic_sim, static_cast<std::uint32_t>(u)));
      }
      ports.bus->wait(kAgain_s);
      follow_orders();
    }
  }

  void join(std::size_t u) {
    User& user = users_[u];
    const std::uint64_t stamp = world.facts().stamp;
    ports.serve(u, report_.sender);
    ports.status.begins(ProgramKind::haptic_sim, static_cast<std::uint32_t>(u), ports.reports[u].sender_participant());
    while (ports.reports[u].take(report_) == Take::sample) {
    }
    user.present = true;
    user.lost = user.dismissed = false;
    user.next_report = stamp;
    if (world.user_facts(u).absent) {
      measures.returns(u, world.facts().time_s);
      record(events_, PresenceEvent::Kind::joins, static_cast<int>(u), world.facts().time_s);
      ports.status.note(fmt::format("user {} takes part from t = {:.3f} s on", u, world.facts().time_s));
    }
    publish_frame(u, false, 0.0, 1.0);
  }

  /// Throws `Error` (usage) where an engine of the plan is unknown.
  void check_plan() const {
    for (const PresenceEvent& event : scene.settings.presence) {
      if (event.kind != PresenceEvent::Kind::engine) continue;
      const auto wanted = parse_engine_order(order_of(event));
      EngineSettings settings;
      settings.change_to(wanted->engine, wanted->preset);
      const std::string fault = exchange.refusal(settings);
      if (!fault.empty()) check_planned(event, {OrderState::refused, fault});
    }
  }

  /// The orders of the plan that are due before this cycle.
  void follow_plan() {
    const double to_s = world.facts().time_s + 0.5 * scene.settings.h_s;
    const double from_s = std::exchange(planned_to_s_, to_s);
    for (const PresenceEvent& event : due_orders(scene.settings.presence, kWorld, from_s, to_s)) {
      check_planned(event, follow(order_of(event)));
      follow_exchange();
    }
  }

  /// The programs of a user who was to join later may still look for the world. They end with its last frame, so the
  /// world stays until they have: they could not find one that is gone.
  void await_newcomers() {
    ports.status.enter("stopping");
    const TimePoint begin = Clock::now();
    for (std::uint32_t u = 0; u < user_count(); ++u) {
      const bool came = users_[u].present || users_[u].former != 0;
      if (came || std::ranges::find(options.without, static_cast<int>(u)) != options.without.end()) continue;
      const auto all = [&](auto holds) { return holds(ProgramKind::haptic_sim) && holds(ProgramKind::device_sim); };
      const auto lives = [&](ProgramKind one) { return ports.status.met(one, u) && ports.status.hears(one, u); };
      const auto ended = [&](ProgramKind one) { return ports.status.has_ended(one, u); };
      while (stop_signal() == 0 && !all(ended)) {
        const bool any = lives(ProgramKind::haptic_sim) || lives(ProgramKind::device_sim);
        if (to_seconds(Clock::now() - begin) > (any ? kNewcomer_s : kDiscovery_s)) break;
        ports.bus->wait(kAgain_s);
      }
    }
  }

  /// A run that ended before a user was to join repeats without this user too.
  void record_never_present() {
    for (const PresenceEvent& event : scene.settings.presence) {
      const auto is_users = [&](const PresenceEvent& one) { return one.user == event.user; };
      const bool joins = event.kind == PresenceEvent::Kind::joins;
      if (joins && !users_[static_cast<std::size_t>(event.user)].present && std::ranges::none_of(events_, is_users))
        events_.push_back(event);
    }
  }

  void wait_while_paused() {
    follow_plan();
    follow_orders();
    while (!control_.may_step() && !control_.stopped() && stop_signal() == 0) {
      ports.bus->wait(0.05);
      follow_orders();
    }
  }

  /// A cycle. True for the last one.
  bool step() {
    const TimePoint begin = stages_.mark(WorldStage::control);
    const double begin_s = world.facts().time_s;
    world.step([this](WorldStage stage) { stages_.mark(stage); });
    // A stop takes effect between cycles, and as a last frame: so every program ends in order.
    const bool stops = stop_signal() != 0 || control_.stopped(), last = world.facts().over || stops;
    if (stops) events_.push_back({.kind = PresenceEvent::Kind::stops, .user = kWorld, .at_s = begin_s});
    publish(last);
    measures.cycle(world, {to_seconds(stages_.mark(WorldStage::send) - begin)}, 1.0, 0.0);
    measures.bodies().record(world, std::numeric_limits<double>::infinity());
    if (snapshots_.wanted(world.facts().time_s) || last) {
      world.look(view_);
      snapshots_.publish(view_, last);
    }
    ports.status.update(measures.state(world, 1.0));
    end_cycle();
    return last;
  }

  /// Receives every report that the world uses before its next cycle. False when asked to stop and one does not come.
  bool receive_due() {
    for (std::size_t u = 0; u < user_count(); ++u) {
      User& user = users_[u];
      while (user.present && user.delay.report_due(user.next_report, world.facts().stamp, world.timetable())) {
        if (!world.has_report(u, user.next_report) && !receive(u, user.next_report)) {
          if (user.present) return false;
          break;
        }
        ++user.next_report;
      }
    }
    return true;
  }

  /// False when asked to stop, and where the user is absent from now on.
  bool receive(std::size_t user, std::uint64_t stamp) {
    const Peer haptic{ProgramKind::haptic_sim, static_cast<std::uint32_t>(user)};
    const auto ours = [&](const HapticReport& came) { return ports.belongs(user, came); };
    const auto gives_up = [this] { return gives_up_at_signal(); };
    const auto lose = [&](const std::string& text) {
      if (scene.settings.absent == Absent::end) throw Error(ExitCode::failed, text + kEndsWithoutIt);
      leave(user, text);
    };
    // One that has just joined may still ask: it has not heard the answer yet, and lives.
    do {
      if (!await(*ports.bus, ports.status, ports.reports[user], report_, stages_, haptic, ours, gives_up, lose))
        return false;
    } while (asks_to_take_part(report_));
    for (const MissedStates& missed : report_.missed) record_missed(events_, static_cast<int>(user), missed);
    for (const FollowedOrder& order : report_.followed) {
      events_.push_back({.kind = PresenceEvent::Kind::engine,
                         .user = static_cast<int>(user),
                         .at_s = order.at_s,
                         .order = order.engine});
    }
    if (world.receive(std::move(report_)) && world.has_report(user, stamp)) return true;
    throw Error(ExitCode::failed, fmt::format("haptic_sim {} sent a report out of turn at stamp {}; are two of them on "
                                              "this domain?",
                                              user, world.facts().stamp));
  }

  /// After a stop signal the world waits a little longer: a report that comes lets every program end in order.
  bool gives_up_at_signal() {
    if (stop_signal() == 0) return false;
    if (asked_ == TimePoint{}) asked_ = Clock::now();
    return to_seconds(Clock::now() - asked_) > kLastReport_s;
  }

  Snapshots snapshots_;
  WorldView view_;
  struct User {
    Delay delay;
    bool present = false;
    bool lost = false;              ///< its programs have fallen silent
    bool dismissed = false;         ///< by order, so that nobody is waited for
    std::uint64_t next_report = 0;  ///< stamp of the one that is received next
    std::uint64_t former = 0;       ///< the haptic process that was served last
    TimePoint asks_at{};
  };
  std::vector<User> users_;
  double planned_to_s_ = -1.0;  ///< orders of the plan until then have been followed
  TimePoint asked_{};           ///< to stop
};

}  // namespace

Ending run_lockstep(const WorldRun& run) { return LockstepLoop(run).run(); }

}  // namespace subworld
