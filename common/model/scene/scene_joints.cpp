#include "model/scene/scene_reader.hpp"
#include "model/trigonometry.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <span>

namespace subworld {

namespace {

/// A coordinate of a joint as a scene names it.
struct Coordinate {
  std::string_view key;
  int first, last;  ///< axes
  [[nodiscard]] bool turns() const noexcept { return first >= 3; }
};
constexpr Coordinate kSlide{"slide", 2, 2}, kTurn{"turn", 5, 5};

struct Kind {
  std::string_view name;
  std::vector<std::string_view> frame;  ///< keys of its directions
  std::vector<Coordinate> free;

  [[nodiscard]] std::vector<std::string_view> keys() const {
    std::vector<std::string_view> all = frame;
    for (const Coordinate& coordinate : free) all.push_back(coordinate.key);
    return all;
  }
};
const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all{
      {"fixed", {}, {}},
      {"hinge", {"axis"}, {kTurn}},
      {"slider", {"axis"}, {kSlide}},
      {"ball", {}, {{"turns", 3, 5}}},
      {"universal", {"axis", "second_axis"}, {{"turn", 3, 3}, {"second_turn", 4, 4}}},
      {"cylindrical", {"axis"}, {kSlide, kTurn}},
      {"planar", {"axis"}, {{"slides", 0, 1}, kTurn}},
      {"six",
       {"rotation"},
       {{"x", 0, 0}, {"y", 1, 1}, {"z", 2, 2}, {"turn_x", 3, 3}, {"turn_y", 4, 4}, {"turn_z", 5, 5}}},
  };
  return all;
}

const std::vector<std::string_view> kCommonKeys{"name", "type",    "bodies",        "between",
                                                "at_m", "collide", "break_force_n", "break_torque_n_m"};
constexpr double kSquare = 1e-3;                         ///< largest cosine of axes that are perpendicular
constexpr Limits kStrength{.least = 0.0, .most = 1e12};  // N, N m and so on
constexpr double kDegree = M_PI / 180.0;

/// Keys of a coordinate, of a place or of an angle.
struct AxisKeys {
  std::string_view limits, friction, stiffness, damping, rest, speed, most;
  double unit;  ///< of limits and rest
};
constexpr AxisKeys kOfPlace{"limits_m", "friction_n", "stiffness_n_m", "damping_n_s_m",
                            "rest_m",   "speed_m_s",  "force_limit_n", 1.0};
constexpr AxisKeys kOfAngle{"limits_deg", "friction_n_m", "stiffness_n_m_rad", "damping_n_m_s",
                            "rest_deg",   "speed_rad_s",  "torque_limit_n_m",  kDegree};

JointAxis read_axis(const YamlValue& value, bool turns, bool several) {
  const AxisKeys& keys = turns ? kOfAngle : kOfPlace;
  const YamlMap map(value,
                    {keys.limits, keys.friction, keys.stiffness, keys.damping, keys.rest, keys.speed, keys.most});
  const Limits place = turns ? Limits{.least = -180.0, .most = 180.0} : kPlace;
  JointAxis axis{.free = true};
  map.read(keys.friction, axis.friction, kStrength);
  map.read(keys.stiffness, axis.stiffness, kStrength);
  map.read(keys.damping, axis.damping, kStrength);
  map.read(keys.most, axis.most, kStrength);
  if (several) {
    map.forbid({keys.limits, keys.rest, keys.speed}, "they hold for several directions; use a joint of type six");
  }
  if (const auto at = map.find(keys.limits)) {
    const std::vector<double> limits = at->numbers(2, place);
    if (limits[0] > limits[1]) at->fail("the lower limit comes first; exchange them");
    axis.lower = keys.unit * limits[0];
    axis.upper = keys.unit * limits[1];
    if (limits[0] == limits[1] && limits[0] != 0.0)
      at->fail("the range has no length; place the bodies there and write [0, 0], which locks the direction");
    if (limits[0] == limits[1]) return {};
  }
  if (const auto at = map.find(keys.rest)) {
    axis.rest = keys.unit * at->number(place);
    if (axis.stiffness == 0.0) at->fail(fmt::format("only a spring has a rest; add {}", keys.stiffness));
  }
  if (const auto at = map.find(keys.speed)) {
    axis.speed = at->number(kPlace);
    if (!map.has(keys.most)) at->fail(fmt::format("a motor has a limit; add {}", keys.most));
    if (axis.damping == 0.0) axis.damping = INFINITY;
  }
  if (map.has(keys.most) && !axis.is_driven()) {
    map.at(keys.most).fail(fmt::format("nothing drives this direction; add {} or {}", keys.speed, keys.stiffness));
  }
  return axis;
}

Quat read_frame(const YamlMap& map, const Kind& kind) {
  if (kind.frame.empty()) return Quat::Identity();
  if (kind.name == "six") return read_rotation(map);
  const Vec3 first = map.at("axis").direction();
  if (kind.name != "universal") return turn_of_z(first);
  const YamlValue at = map.at("second_axis");
  const Vec3 second = at.direction();
  if (std::abs(second.dot(first)) > kSquare) at.fail("must be perpendicular to \"axis\"");
  Eigen::Matrix3d axes;
  axes.col(0) = first;
  axes.col(2) = first.cross(second).normalized();
  axes.col(1) = axes.col(2).cross(first);
  return Quat(axes);
}

/// Everything but its bodies and where it is.
Joint read_joint_kind(const YamlMap& map, const Kind& kind) {
  Joint joint;
  joint.kind = static_cast<JointKind>(&kind - kinds().data());
  joint.in_a.orientation = read_frame(map, kind);  // in the world for now
  for (const Coordinate& coordinate : kind.free) {
    const auto at = map.find(coordinate.key);
    if (!at && kind.name == "six") continue;
    JointAxis axis{.free = true};
    if (at) axis = read_axis(*at, coordinate.turns(), coordinate.last > coordinate.first);
    std::fill(&joint.axes[coordinate.first], &joint.axes[coordinate.last] + 1, axis);
  }
  map.read("break_force_n", joint.break_force_n, kPositive);
  map.read("break_torque_n_m", joint.break_torque_n_m, kPositive);
  map.read("collide", joint.collide);
  return joint;
}

}  // namespace

void JointReader::read(const YamlValue& list) {
  Faults faults;
  for (const YamlValue& joint : list.items()) faults.collect([&] { read_joint(joint); });
  faults.raise();
}

void JointReader::read_joint(const YamlValue& value) {
  std::vector<std::string_view> names, keys = kCommonKeys;
  for (const Kind& kind : kinds()) {
    names.push_back(kind.name);
    for (const std::string_view key : kind.keys()) {
      if (std::ranges::find(keys, key) == keys.end()) keys.push_back(key);
    }
  }
  Faults faults;
  const YamlMap map(value, keys, faults);
  const Kind& kind = kinds()[map.at("type").choice(names)];
  const std::vector<std::string_view> own = kind.keys();
  for (const std::string_view key : std::span(keys).subspan(kCommonKeys.size())) {
    if (std::ranges::find(own, key) != own.end()) continue;
    faults.collect([&] { map.forbid({key}, fmt::format("the type is \"{}\"", kind.name)); });
  }
  Joint joint;
  faults.collect([&] { joint.name = map.at("name").name(); });
  const std::string name = joint.name;
  faults.collect([&] {
    joint = read_joint_kind(map, kind);
    joint.name = name;
  });
  faults.collect([&] {
    if (map.one_of({"bodies", "between"}) == 0) {
      const std::vector<YamlValue> pair = map.at("bodies").items();
      if (pair.size() != 2) map.at("bodies").fail("a joint connects two bodies; name both, one may be fixed");
      joint.a = bodies_.find_body(pair[0]);
      joint.b = bodies_.find_body(pair[1]);
      const auto at = map.find("at_m");
      if (!at && kind.name != "fixed") (void)map.at("at_m");
      faults.raise();
      add(map, joint, at ? at->vec3(kPlace) : scene_.initial[index(joint.a)].position);
    } else {
      map.forbid({"at_m"}, "each of these joints is halfway between its bodies");
      const std::vector<BodyId> copies = bodies_.find_copies(map.at("between"));
      faults.raise();
      for (std::size_t i = 0; i + 1 < copies.size(); ++i) {
        joint.a = copies[i + 1];
        joint.b = copies[i];
        joint.name = fmt::format("{}/{}", name, i);
        add(map, joint, 0.5 * (scene_.initial[index(joint.a)].position + scene_.initial[index(joint.b)].position));
      }
    }
  });
  faults.raise();
}

void JointReader::add(const YamlMap& map, Joint joint, const Vec3& at) {
  const YamlValue place = map.at("name");
  if (!names_.insert(joint.name).second)
    place.fail(fmt::format("there is another joint \"{}\"; rename one", joint.name));
  if (joint.a == joint.b) map.whole().fail("a joint connects two different bodies");
  if (scene_.body(joint.a).fixed() && scene_.body(joint.b).fixed())
    map.whole().fail("both bodies are fixed; a joint needs one that moves");
  if (scene_.joints.size() >= kMostBodies) place.fail(fmt::format("a scene has at most {} joints", kMostBodies));
  const Pose frame{at, joint.in_a.orientation};
  const auto in = [&](BodyId id) {
    const BodyState& state = scene_.initial[index(id)];
    const Quat back = state.orientation.conjugate();
    return Pose{back * (frame.position - state.position), (back * frame.orientation).normalized()};
  };
  joint.in_a = in(joint.a);
  joint.in_b = in(joint.b);
  scene_.joints.push_back(std::move(joint));
}

}  // namespace subworld
