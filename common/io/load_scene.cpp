#include "io/options.hpp"
#include "io/scene_name.hpp"
#include "model/error.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace subworld {

namespace {

template <class T>
void override_with(T& setting, const std::optional<T>& option) {
  if (option) setting = *option;
}

/// Throws `Error` (usage) for presence that the run cannot have.
void check_presence(const Options& o, const Scene& scene) {
  const Settings& s = scene.settings;
  const std::string where = o.presence ? "--presence" : o.scene + ": settings.presence";
  if (const std::string fault = presence_fault(s.presence, s.users); !fault.empty())
    throw Error(ExitCode::usage, fmt::format("{}: {}", where, fault));
  if (s.mode == Mode::lockstep || s.presence.empty()) return;
  throw Error(ExitCode::usage,
              fmt::format("{}: planned presence acts in lock-step only; in real time use --without and `subworld "
                          "control leave`, or run with --mode lockstep",
                          where));
}

}  // namespace

void check_without(const Options& options, const Scene& scene) {
  if (options.without.empty()) return;
  if (scene.settings.mode != Mode::realtime)
    throw Error(
        ExitCode::usage,
        "--without acts in real time; in lock-step use --presence, as in --presence \"1 joins 3\", or --mode realtime");
  const int users = scene.settings.users;
  int present = users;
  for (int user = 0; user < users; ++user) present -= std::ranges::find(options.without, user) != options.without.end();
  for (const int user : options.without) {
    if (user >= users)
      throw Error(ExitCode::usage,
                  fmt::format("--without {}: there is no such user; the run has {}, from 0", user, users));
  }
  if (present == 0) throw Error(ExitCode::usage, "--without: names every user; a run begins with at least one");
}

Scene load_scene(const Options& o) {
  Scene scene = load_scene(scene_file(o.scene));
  Settings& s = scene.settings;
  if (o.mode) s.mode = *o.mode == "realtime" ? Mode::realtime : Mode::lockstep;
  if (o.absent) s.absent = *o.absent == "wait" ? Absent::wait : *o.absent == "continue" ? Absent::go_on : Absent::end;
  if (o.presence) {
    s.presence.clear();
    (void)parse_presence(*o.presence, s.presence);
  }
  override_with(s.scheme, o.scheme);
  // A scene's longest sub-step is meant for the engine and preset that it names.
  if (o.engine || o.preset) s.world.longest_substep_s.reset();
  if (o.haptic_engine || o.haptic_preset) s.haptic.longest_substep_s.reset();
  override_with(s.world.name, o.engine);
  override_with(s.haptic.name, o.haptic_engine);
  override_with(s.world.preset, o.preset);
  override_with(s.haptic.preset, o.haptic_preset);
  if (o.ratio) s.set_ratio(*parse_ratio(*o.ratio));
  override_with(s.users, o.users);
  override_with(s.delay.jitter_s, o.jitter_s);
  if (o.latency_s) s.delay.up_s = s.delay.down_s = 0.5 * *o.latency_s;
  if (o.device_latency_s) s.delay.from_device_s = s.delay.to_device_s = 0.5 * *o.device_latency_s;
  override_with(s.delay.loss_ratio, o.loss_ratio);
  if (o.passivity) {
    s.passivity = *o.passivity == "on" ? Passivity::on : *o.passivity == "off" ? Passivity::off : Passivity::automatic;
  }
  override_with(s.deadband, o.deadband);
  s.disable(parse_disabled(o.disabled));
  s.remote = std::ranges::any_of(o.network.peers, is_remote);
  if (s.mode == Mode::realtime && s.delay.any()) {
    throw Error(ExitCode::usage,
                fmt::format("{}: artificial delay and loss act in lock-step only; remove settings.delay, --latency, "
                            "--device-latency, --jitter and --loss, or run with --mode lockstep",
                            o.scene));
  }
  override_with(s.duration_s, o.duration_s);
  const int declared = static_cast<int>(scene.users.size());
  if (s.users == 0) s.users = declared;
  if (s.users > declared) {
    throw Error(ExitCode::usage,
                fmt::format("--users {}: {} declares {} user{}; declare more under `users`, or ask for fewer", s.users,
                            o.scene, declared, declared == 1 ? "" : "s"));
  }
  keep_users(scene, s.users);
  check_presence(o, scene);
  if (o.budget_ratio) {
    for (UserSpec& user : scene.users) {
      user.selection = Selection::budget;
      user.budget_ratio = *o.budget_ratio;
    }
  }
  if (o.budget_limit_ratio) limit_budgets(scene, *o.budget_limit_ratio);
  if (o.user >= s.users) {
    throw Error(ExitCode::usage,
                fmt::format("--user {}: {} user{} in {}, counted from 0; {}", o.user, s.users,
                            s.users == 1 ? " takes part" : "s take part", o.scene,
                            o.user < declared ? "for more give --users" : "declare more under `users`"));
  }
  return scene;
}

int limit_budgets(Scene& scene, double limit_ratio) {
  int lowered = 0;
  for (UserSpec& user : scene.users) {
    if (user.selection != Selection::budget || user.budget_ratio <= limit_ratio) continue;
    user.budget_ratio = limit_ratio;
    ++lowered;
  }
  return lowered;
}

}  // namespace subworld
