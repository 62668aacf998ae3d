#include "model/settings/agreed_settings.hpp"

#include "model/hash.hpp"
#include "model/joined.hpp"
#include "model/settings/settings.hpp"

#include <fmt/core.h>

#include <array>
#include <bit>
#include <concepts>
#include <map>
#include <string_view>
#include <type_traits>

namespace subworld {

namespace {

/// FNV-1a over a canonical byte stream: integers and doubles as 8 bytes, least significant first; text and lists after
/// their length.
class Hasher {
 public:
  [[nodiscard]] std::uint64_t value() const noexcept { return value_; }

  template <typename... T>
  void add(const T&... parts) {
    (put(parts), ...);
  }

 private:
  void put(std::uint64_t bits) {
    for (unsigned shift = 0; shift < 64; shift += 8) byte(static_cast<unsigned char>(bits >> shift));
  }
  template <typename T>
  requires std::integral<T> || std::is_enum_v<T>
  void put(T number) { put(static_cast<std::uint64_t>(number)); }
  void put(double number) { put(std::bit_cast<std::uint64_t>(number + 0.0)); }  // + 0.0: -0 and 0 are the same scene
  void put(const std::string& text) {
    put(std::uint64_t{text.size()});
    for (const char c : text) byte(static_cast<unsigned char>(c));
  }
  void put(const Vec3& v) { add(v.x(), v.y(), v.z()); }
  void put(const Quat& q) { add(q.x(), q.y(), q.z(), q.w()); }
  void put(const std::array<std::uint32_t, 3>& t) { add(t[0], t[1], t[2]); }
  template <typename T>
  void put(const std::vector<T>& list) {
    put(std::uint64_t{list.size()});
    for (const T& item : list) put(item);
  }
  void put(const Mesh& m) { add(m.vertices, m.triangles, m.parts); }
  void put(const BodyPart& p) {
    put(p.shape);
    add(p.pose.position, p.pose.orientation, p.material.friction, p.material.restitution, p.material.rolling_friction,
        p.material.spinning_friction, p.material.number);
  }
  void put(const Shape& s) { add(s.kind, s.half_extents, s.radius, s.half_length, s.mesh); }
  void put(const Body& b) {
    add(b.id, b.name, b.shape);
    add(b.material.friction, b.material.restitution, b.mass, b.inertia, b.gravity, b.rotates, b.at_rest);
    add(b.material.rolling_friction, b.material.spinning_friction, b.material.number, b.surface_velocity,
        b.surface_turn, b.group);
  }
  void put(const MaterialPair& p) {
    add(p.a, p.b, p.friction.value_or(-1.0), p.restitution.value_or(-1.0), p.rolling_friction.value_or(-1.0),
        p.spinning_friction.value_or(-1.0));
  }
  void put(const JointAxis& a) {
    add(a.free, a.lower, a.upper, a.friction, a.stiffness, a.damping, a.rest, a.speed, a.most);
  }
  void put(const Joint& j) {
    add(j.name, j.kind, j.a, j.b, j.in_a.position, j.in_a.orientation, j.in_b.position, j.in_b.orientation);
    for (const JointAxis& axis : j.axes) put(axis);
    add(j.break_force_n, j.break_torque_n_m, j.collide);
  }
  void put(const PathSegment& s) {
    add(s.kind, s.from_s, s.to_s, s.profile ? 1 + static_cast<int>(*s.profile) : 0, s.every_s, s.displacement, s.axis,
        s.angle, s.radius, s.period_s);
    add(s.along, s.across, s.amplitude, s.wavenumber);
  }
  void put(const BodyState& s) { add(s.position, s.orientation, s.linear_velocity, s.angular_velocity); }

  void byte(unsigned char b) { value_ = hashed(value_, b); }

  std::uint64_t value_ = kHashSeed;
};

constexpr std::array kShapeWords{"sphere", "box", "capsule", "cylinder", "plane", "convex", "mesh"};

}  // namespace

std::vector<NamedSetting> agreed_settings(const Scene& scene) {
  Settings settings = scene.settings;
  std::vector<NamedSetting> list{{"name", scene.name}};
  const auto add = [&](const std::string& at, const Setting& setting, UserSpec& user) {
    if (const auto text = value_text(setting, settings, user)) list.push_back({at, *text});
  };
  UserSpec none;
  for (const Setting& one : settings_table()) {
    if (!one.of_user() && one.key != "duration_s") add("settings." + one.key, one, none);
  }
  for (std::size_t u = 0; u < scene.users.size(); ++u) {
    UserSpec user = scene.users[u];
    const std::string at = fmt::format("users[{}].", u);
    for (const Setting& one : settings_table()) {
      if (one.of_user()) add(at + one.key.substr(one.key.find('.') + 1), one, user);
    }
    Hasher path;
    path.add(user.device.path);
    list.push_back({at + "name", user.name});
    list.push_back({at + "proxy", fmt::format("{}", index(user.proxy))});
    list.push_back({at + "joins", user.joins_late ? "after_settling" : "start"});
    list.push_back({at + "device.path", fmt::format("{:016x}", path.value())});
  }
  Hasher bodies;
  bodies.add(scene.meshes, scene.bodies, scene.initial, scene.joints, scene.settings.world.pairs);
  list.push_back({"bodies", fmt::format("{:016x}", bodies.value())});
  return list;
}

std::vector<NamedSetting> settings_of(const Body& body) {
  const auto flag = [](bool value) { return std::string(value ? "true" : "false"); };
  const auto number = [](double value) { return fmt::format("{}", value + 0.0); };
  const auto vector = [](const Vec3& v) { return fmt::format("[{}, {}, {}]", v.x() + 0.0, v.y() + 0.0, v.z() + 0.0); };
  return {{"name", body.name},
          {"shape", kShapeWords[static_cast<std::size_t>(body.shape.kind)]},
          {"half_extents_m", vector(body.shape.half_extents)},
          {"radius_m", number(body.shape.radius)},
          {"half_length_m", number(body.shape.half_length)},
          {"friction", number(body.material.friction)},
          {"restitution", number(body.material.restitution)},
          {"mass_kg", number(body.mass)},
          {"inertia_kg_m2", vector(body.inertia)},
          {"gravity", flag(body.gravity)},
          {"rotates", flag(body.rotates)}};
}

std::string difference(std::span<const NamedSetting> own, std::span<const NamedSetting> world, std::size_t named,
                       const char* where) {
  std::map<std::string_view, std::string_view> others;
  for (const NamedSetting& setting : world) others.emplace(setting.name, setting.value);
  std::vector<std::string> different;
  const auto compare = [&](std::string_view name, std::string_view value, std::string_view other) {
    if (value != other) different.push_back(fmt::format("{} is {}, {} {}", name, value, where, other));
  };
  for (const NamedSetting& setting : own) {
    const auto other = others.find(setting.name);
    compare(setting.name, setting.value, other == others.end() ? "not set" : other->second);
    if (other != others.end()) others.erase(other);
  }
  for (const auto& [name, value] : others) compare(name, "not set", value);
  if (different.size() <= named) return joined(different, "; ");
  const std::size_t more = different.size() - named;
  different.resize(named);
  return fmt::format("{}; and {} more", joined(different, "; "), more);
}

std::uint64_t settings_hash(const Scene& scene) {
  Hasher hash;
  for (const NamedSetting& setting : agreed_settings(scene)) hash.add(setting.name, setting.value);
  return hash.value();
}

}  // namespace subworld
