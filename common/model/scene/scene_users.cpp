#include "model/scene/scene_reader.hpp"

#include <fmt/core.h>

#include <cmath>
#include <limits>

namespace subworld {

namespace {

constexpr Limits kTime{.least = 0.0, .most = 1e6};                           // s
constexpr Limits kLongerThanZero{.least = 0.0, .most = 1e6, .above = true};  // s, m

const std::initializer_list<std::string_view> kSegmentForms = {"move", "turn", "circle", "wave"};
const std::initializer_list<std::string_view> kProfiles = {"constant", "minimum_jerk"};

void read_during(const YamlMap& map, PathSegment& segment) {
  map.forbid({"from_s", "to_s"}, "this segment has during_s");
  const YamlValue during = map.at("during_s");
  const std::vector<double> span = during.numbers(2, kTime);
  if (!(span[1] > span[0])) during.fail(fmt::format("must end after it begins, not [{}, {}]", span[0], span[1]));
  segment.from_s = span[0];
  segment.to_s = span[1];
  if (const auto profile = map.find("profile")) segment.profile = static_cast<Profile>(profile->choice(kProfiles));
  if (const auto every = map.find("every_s")) {
    segment.every_s = every->number(kTime);
    if (segment.every_s < span[1] - span[0]) {
      every->fail(fmt::format("must be at least the {:g} s that the segment takes, not {:g}", span[1] - span[0],
                              segment.every_s));
    }
  }
}

void read_from_to(const YamlMap& map, PathSegment& segment, bool ends) {
  map.forbid({"during_s", "every_s", "profile"}, "circle and wave have from_s");
  map.read("from_s", segment.from_s, kTime);
  segment.to_s = std::numeric_limits<double>::infinity();
  if (!ends) map.forbid({"to_s"}, "a wave lasts as long as its path");
  if (const auto to = map.find("to_s")) {
    segment.to_s = to->number(kTime);
    if (!(segment.to_s > segment.from_s)) {
      to->fail(fmt::format("must be after from_s, {}, not {}", segment.from_s, segment.to_s));
    }
  }
}

PathSegment read_segment(const YamlValue& value) {
  const YamlMap map(value, {"move", "turn", "circle", "wave", "during_s", "every_s", "profile", "from_s", "to_s"});
  PathSegment segment;
  segment.kind = static_cast<PathSegment::Kind>(map.one_of(kSegmentForms));
  switch (segment.kind) {
    case PathSegment::Kind::move:
      segment.displacement = map.at("move").vec3({.least = -1e6, .most = 1e6});
      read_during(map, segment);
      break;
    case PathSegment::Kind::turn: {
      const YamlMap turn(map.at("turn"), {"axis", "angle_deg"});
      segment.axis = turn.at("axis").direction();
      segment.angle = turn.at("angle_deg").number({.least = -36000.0, .most = 36000.0}) * (M_PI / 180.0);
      read_during(map, segment);
      break;
    }
    case PathSegment::Kind::circle: {
      const YamlMap circle(map.at("circle"), {"radius_m", "period_s", "axis"});
      segment.radius = circle.at("radius_m").number(kLongerThanZero);
      segment.period_s = circle.at("period_s").number({.least = 1e-3, .most = 1e6});
      if (const auto axis = circle.find("axis")) segment.axis = axis->direction();
      read_from_to(map, segment, true);
      break;
    }
    case PathSegment::Kind::wave: {
      const YamlMap wave(map.at("wave"), {"along", "across", "amplitude_m", "wavenumber_rad_m"});
      segment.along = wave.at("along").direction();
      segment.across = wave.at("across").direction();
      segment.amplitude = wave.at("amplitude_m").number({.least = -1e6, .most = 1e6});
      segment.wavenumber = wave.at("wavenumber_rad_m").number({.least = -1e6, .most = 1e6});
      read_from_to(map, segment, false);
      break;
    }
  }
  return segment;
}

void read_path(const YamlValue& path, DeviceSpec& device) {
  Faults faults;
  for (const YamlValue& item : path.items()) {
    faults.collect([&] {
      device.path.push_back(read_segment(item));
      if (device.path.back().kind == PathSegment::Kind::turn && device.degrees_of_freedom == 3) {
        item.fail("a device with 3 degrees of freedom does not turn; set degrees_of_freedom: 6 or remove the turn");
      }
    });
  }
  faults.raise();
}

/// The name, the proxy and when it joins.
void read_tool(const YamlMap& map, BodyReader& bodies, const Scene& scene, UserSpec& user) {
  user.name = map.at("name").name();
  const YamlValue proxy = map.at("proxy");
  for (const UserSpec& other : scene.users) {
    if (other.name == user.name)
      map.at("name").fail(fmt::format("there is another user \"{}\"; rename one", user.name));
  }
  const std::size_t others = scene.bodies.size();
  user.proxy = bodies.read_proxy(proxy, user.name);
  user.own_proxy = scene.bodies.size() > others;
  if (const auto joins = map.find("joins")) {
    user.joins_late = joins->choice({"start", "after_settling"}) == 1;
    if (user.joins_late && !user.own_proxy) {
      joins->fail("a body of the scene is there from the start; describe a proxy of the user's own or remove the key");
    }
  }
  for (const UserSpec& other : scene.users) {
    if (other.proxy == user.proxy) {
      proxy.fail(fmt::format("is the proxy of \"{}\" already; give every user a body of its own", other.name));
    }
  }
}

void read_user(const YamlValue& item, BodyReader& bodies, Scene& scene) {
  Faults faults;
  const YamlMap map(item, keys_in("users."), faults);
  UserSpec user;
  faults.collect([&] { read_tool(map, bodies, scene, user); });
  faults.collect([&] {
    read_settings(item, "users.", scene.settings, user);
    if (user.selection == Selection::contacts && user.contact_depth == 0) {
      map.at("selection")
          .fail("contacts: needs contact_depth, how many contacts lie between the proxy and a member at most");
    }
  });
  faults.collect([&] {
    if (const auto device = map.find("device")) {
      if (const auto path = YamlMap(*device, keys_in("users.device.")).find("path")) read_path(*path, user.device);
    }
  });
  faults.raise();
  scene.users.push_back(std::move(user));
}

}  // namespace

void read_users(const YamlValue& list, BodyReader& bodies, Scene& scene) {
  const std::vector<YamlValue> items = list.items();
  if (items.empty()) list.fail("a scene needs at least one user; add one");
  if (items.size() > kMostUsers)
    list.fail(fmt::format("{} users; a scene has at most {}: split it", items.size(), kMostUsers));
  Faults faults;
  for (const YamlValue& item : items) faults.collect([&] { read_user(item, bodies, scene); });
  faults.raise();
}

void keep_users(Scene& scene, int count) {
  while (static_cast<int>(scene.users.size()) > count) {
    if (scene.users.back().own_proxy) {  // proxies come last, in the order of the users
      scene.bodies.pop_back();
      scene.initial.pop_back();
    }
    scene.users.pop_back();
  }
  scene.settings.users = static_cast<int>(scene.users.size());
}

}  // namespace subworld
