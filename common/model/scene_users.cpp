#include "model/scene_reader.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>

namespace subworld {

namespace {

constexpr Limits kTime{.least = 0.0, .most = 1e6};                           // s
constexpr Limits kLongerThanZero{.least = 0.0, .most = 1e6, .above = true};  // s, m
constexpr Limits kLarge{.least = 0.0, .most = 1e9};
constexpr Limits kLargePositive{.least = 0.0, .most = 1e9, .above = true};

const std::initializer_list<std::string_view> kSegmentForms = {"move", "turn", "circle", "wave"};

void read_during(const YamlMap& map, PathSegment& segment) {
  map.forbid({"from_s", "to_s"}, "this segment has during_s");
  const YamlValue during = map.at("during_s");
  const std::vector<double> span = during.numbers(2, kTime);
  if (!(span[1] > span[0])) during.fail(fmt::format("must end after it begins, not [{}, {}]", span[0], span[1]));
  segment.from_s = span[0];
  segment.to_s = span[1];
  if (const auto every = map.find("every_s")) {
    segment.every_s = every->number(kTime);
    if (segment.every_s < span[1] - span[0]) {
      every->fail(fmt::format("must be at least the {:g} s that the segment takes, not {:g}", span[1] - span[0],
                              segment.every_s));
    }
  }
}

void read_from_to(const YamlMap& map, PathSegment& segment, bool ends) {
  map.forbid({"during_s", "every_s"}, "circle and wave have from_s");
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
  const YamlMap map(value, {"move", "turn", "circle", "wave", "during_s", "every_s", "from_s", "to_s"});
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

void read_coupling(const YamlValue& value, CouplingSettings& coupling) {
  const YamlMap map(value, {"stiffness_n_m", "damping_n_s_m", "rotational_stiffness_n_m_rad",
                            "rotational_damping_n_m_s_rad", "ramp_s"});
  map.read("stiffness_n_m", coupling.stiffness_n_m, kLargePositive);
  map.read("damping_n_s_m", coupling.damping_n_s_m, kLarge);
  map.read("rotational_stiffness_n_m_rad", coupling.rotational_stiffness_n_m, kLarge);
  map.read("rotational_damping_n_m_s_rad", coupling.rotational_damping_n_m_s, kLarge);
  map.read("ramp_s", coupling.ramp_s, kTime);
}

OperatorSpec read_operator(const YamlValue& value) {
  const YamlMap map(value, {"mass_kg", "damping_n_s_m", "stiffness_n_m", "inertia_kg_m2",
                            "rotational_damping_n_m_s_rad", "rotational_stiffness_n_m_rad"});
  OperatorSpec model;
  map.read("mass_kg", model.mass_kg, kLargePositive);
  map.read("damping_n_s_m", model.damping_n_s_m, kLarge);
  map.read("stiffness_n_m", model.stiffness_n_m, kLarge);
  map.read("inertia_kg_m2", model.inertia_kg_m2, kLargePositive);
  map.read("rotational_damping_n_m_s_rad", model.rotational_damping_n_m_s, kLarge);
  map.read("rotational_stiffness_n_m_rad", model.rotational_stiffness_n_m, kLarge);
  return model;
}

void read_device(const YamlValue& value, DeviceSpec& device) {
  const YamlMap map(value, {"kind", "degrees_of_freedom", "rate_hz", "force_limit_n", "torque_limit_n_m",
                            "force_rate_limit_n_s", "power_limit_w", "speed_limit_m_s", "mass_kg", "damping_n_s_m",
                            "friction_n", "position_resolution_m", "path", "operator"});
  if (const auto kind = map.find("kind"))
    device.kind = static_cast<DeviceKind>(kind->choice({"impedance", "admittance"}));
  if (const auto freedom = map.find("degrees_of_freedom")) {
    device.degrees_of_freedom = freedom->integer(1, 6);
    if (device.degrees_of_freedom != 3 && device.degrees_of_freedom != 6) {
      freedom->fail(fmt::format("must be 3 (translations) or 6, not {}", device.degrees_of_freedom));
    }
  }
  map.read("rate_hz", device.rate_hz, {.least = 1.0, .most = 100'000.0});
  map.read("force_limit_n", device.force_limit_n, kLargePositive);
  map.read("torque_limit_n_m", device.torque_limit_n_m, kLargePositive);
  if (const auto rate = map.find("force_rate_limit_n_s")) device.force_rate_limit_n_s = rate->number(kLargePositive);
  if (const auto power = map.find("power_limit_w")) device.power_limit_w = power->number(kLargePositive);
  map.read("speed_limit_m_s", device.speed_limit_m_s, {.least = 0.0, .most = 0.5, .above = true});
  map.read("mass_kg", device.mass_kg, kLargePositive);
  map.read("damping_n_s_m", device.damping_n_s_m, kLarge);
  map.read("friction_n", device.friction_n, kLarge);
  map.read("position_resolution_m", device.position_resolution_m, {.least = 0.0, .most = 1.0});
  if (const auto path = map.find("path")) {
    for (const YamlValue& item : path->items()) {
      device.path.push_back(read_segment(item));
      if (device.path.back().kind == PathSegment::Kind::turn && device.degrees_of_freedom == 3) {
        item.fail("a device with 3 degrees of freedom does not turn; set degrees_of_freedom: 6 or remove the turn");
      }
    }
  }
  if (const auto model = map.find("operator")) device.operator_model = read_operator(*model);
}

}  // namespace

void read_users(const YamlValue& list, BodyReader& bodies, Scene& scene) {
  const std::vector<YamlValue> items = list.items();
  if (items.empty()) list.fail("a scene needs at least one user; add one");
  if (items.size() > kMostUsers)
    list.fail(fmt::format("{} users; a scene has at most {}: split it", items.size(), kMostUsers));
  for (const YamlValue& item : items) {
    const YamlMap map(item, {"name", "proxy", "joins", "coupling", "selection", "box_half_m", "contact_depth",
                             "budget_ratio", "device"});
    UserSpec user;
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
        joins->fail(
            "a body of the scene is there from the start; describe a proxy of the user's own or remove the key");
      }
    }
    for (const UserSpec& other : scene.users) {
      if (other.proxy == user.proxy) {
        proxy.fail(fmt::format("is the proxy of \"{}\" already; give every user a body of its own", other.name));
      }
    }
    map.read("box_half_m", user.box_half_m, kLongerThanZero);
    map.read("contact_depth", user.contact_depth, 0, 1000);
    map.read("budget_ratio", user.budget_ratio, {.least = 0.0, .most = 1e6, .above = true});
    if (const auto selection = map.find("selection")) {
      user.selection = static_cast<Selection>(selection->choice({"box", "contacts", "budget"}));
      if (user.selection == Selection::contacts && user.contact_depth == 0) {
        selection->fail("contacts: needs contact_depth, how many contacts lie between the proxy and a member at most");
      }
    }
    if (const auto coupling = map.find("coupling")) read_coupling(*coupling, user.coupling);
    if (const auto device = map.find("device")) read_device(*device, user.device);
    scene.users.push_back(std::move(user));
  }
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
