#include "io/options/options.hpp"
#include "io/options/scene_name.hpp"
#include "model/error.hpp"

#include <fmt/core.h>

#include <algorithm>

namespace subworld {

namespace {

/// Those of short forms first: of one setting, --set wins.
std::vector<SettingChange> changes_of(const Options& o) {
  std::vector<SettingChange> changes;
  for (const auto& [key, value] : o.named) {
    if (value) changes.push_back({key, *value});
  }
  for (const std::string& text : o.set) changes.push_back(parse_change(text));
  return changes;
}

/// Throws `Error` (usage) for settings that exclude each other; in a scene file the reader has found them.
void check_users(const Scene& scene) {
  for (const UserSpec& user : scene.users) {
    if (user.selection == Selection::contacts && user.contact_depth == 0)
      throw Error(
          ExitCode::usage,
          fmt::format("--set users.selection=contacts: needs --set users.contact_depth=N, {} has none", user.name));
    const auto turns = [](const PathSegment& segment) { return segment.kind == PathSegment::Kind::turn; };
    if (user.device.degrees_of_freedom == 3 && std::ranges::any_of(user.device.path, turns))
      throw Error(
          ExitCode::usage,
          fmt::format("--set users.device.degrees_of_freedom=3: the path of {} turns; leave it at 6", user.name));
  }
}

/// Throws `Error` (usage) for presence that the run cannot have.
void check_presence(const Options& o, const Scene& scene) {
  const Settings& s = scene.settings;
  const std::string flag = flag_of(o, "presence");
  const std::string where = flag.empty() ? o.scene + ": settings.presence" : flag;
  if (const std::string fault = presence_fault(s.presence, s.users); !fault.empty())
    throw Error(ExitCode::usage, fmt::format("{}: {}", where, fault));
  if (s.mode == Mode::lockstep || s.presence.empty()) return;
  throw Error(ExitCode::usage,
              fmt::format("{}: planned presence acts in lock-step only; in real time use --without and `subworld "
                          "control leave`, or run with --mode lockstep",
                          where));
}

/// Throws `Error` (usage) for a delay that a sub-world cannot be ahead of.
void check_delay(const std::string& file, const Settings& s) {
  const double round_trip_s = s.delay.up_s + s.delay.down_s + 2.0 * s.delay.jitter_s;
  if (s.mode == Mode::lockstep || round_trip_s <= kLongestRoundTrip_s) return;
  throw Error(
      ExitCode::usage,
      fmt::format("{}: the delay between world and sub-world is {:g} s there and back, with jitter; in real time "
                  "it may be {:g} s: reduce --latency or settings.delay, or run with --mode lockstep",
                  file, round_trip_s, kLongestRoundTrip_s));
}

}  // namespace

void check_without(const Options& options, const Scene& scene) {
  if (options.without.empty()) return;
  if (scene.settings.mode != Mode::realtime)
    throw Error(ExitCode::usage,
                "--without acts in real time; in lock-step use --set presence=\"1 joins 3\", or --mode realtime");
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
  apply_changes(changes_of(o), scene);
  check_users(scene);
  s.remote = std::ranges::any_of(o.network.peers, is_remote);
  check_delay(o.scene, s);
  const int declared = static_cast<int>(scene.users.size());
  if (s.users == 0) s.users = declared;
  if (s.users > declared) {
    throw Error(ExitCode::usage,
                fmt::format("--users {}: {} declares {} user{}; declare more under `users`, or ask for fewer", s.users,
                            o.scene, declared, declared == 1 ? "" : "s"));
  }
  keep_users(scene, s.users);
  check_presence(o, scene);
  if (o.user >= s.users) {
    throw Error(ExitCode::usage,
                fmt::format("--user {}: {} user{} in {}, counted from 0; {}", o.user, s.users,
                            s.users == 1 ? " takes part" : "s take part", o.scene,
                            o.user < declared ? "for more give --users" : "declare more under `users`"));
  }
  return scene;
}

}  // namespace subworld
