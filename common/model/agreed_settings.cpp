#include "model/agreed_settings.hpp"

#include "model/hash.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <bit>
#include <concepts>
#include <map>
#include <optional>
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
  void put(const Mesh& m) { add(m.vertices, m.triangles); }
  void put(const Body& b) {
    add(b.id, b.name, b.shape.kind, b.shape.half_extents, b.shape.radius, b.shape.half_length, b.shape.mesh);
    add(b.material.friction, b.material.restitution, b.mass, b.inertia, b.gravity, b.rotates, b.at_rest);
  }
  void put(const BodyState& s) { add(s.position, s.orientation, s.linear_velocity, s.angular_velocity); }

  void byte(unsigned char b) { value_ = hashed(value_, b); }

  std::uint64_t value_ = kHashSeed;
};

constexpr std::array kModes{"lockstep", "realtime"};
constexpr std::array kAbsent{"end", "wait", "continue"};
constexpr std::array kPassivities{"automatic", "on", "off"};
constexpr std::array kSelections{"box", "contacts", "budget"};
constexpr std::array kDevices{"impedance", "admittance"};
constexpr std::array kSegments{"move", "turn", "circle", "wave"};
constexpr std::array kShapes{"sphere", "box", "capsule", "cylinder", "plane", "convex", "mesh"};

const char* word(Mode mode) { return kModes[static_cast<std::size_t>(mode)]; }
const char* word(Absent absent) { return kAbsent[static_cast<std::size_t>(absent)]; }
const char* word(Passivity passivity) { return kPassivities[static_cast<std::size_t>(passivity)]; }
const char* word(Selection selection) { return kSelections[static_cast<std::size_t>(selection)]; }
const char* word(DeviceKind kind) { return kDevices[static_cast<std::size_t>(kind)]; }
const char* word(PathSegment::Kind kind) { return kSegments[static_cast<std::size_t>(kind)]; }
const char* word(ShapeKind kind) { return kShapes[static_cast<std::size_t>(kind)]; }

/// Settings as names and texts. The names are those of the scene file.
class Lister {
 public:
  [[nodiscard]] std::vector<NamedSetting> take() && { return std::move(list_); }

  void put(const std::string& name, std::string text) { list_.push_back({name, std::move(text)}); }
  void put(const std::string& name, bool value) { put(name, std::string(value ? "true" : "false")); }
  void put(const std::string& name, double value) { put(name, fmt::format("{}", value + 0.0)); }
  template <std::integral T>
  void put(const std::string& name, T value) {
    put(name, fmt::format("{}", value));
  }
  template <class T>
  requires std::is_enum_v<T>
  void put(const std::string& name, T value) { put(name, std::string(word(value))); }
  void put(const std::string& name, const Vec3& v) {
    put(name, fmt::format("[{}, {}, {}]", v.x() + 0.0, v.y() + 0.0, v.z() + 0.0));
  }
  template <class T>
  void put(const std::string& name, const std::optional<T>& value) {
    if (value) put(name, *value);
  }
  template <class T>
  void put(const std::string& name, const std::vector<T>& list) {
    for (std::size_t i = 0; i < list.size(); ++i) put(fmt::format("{}[{}]", name, i), list[i]);
  }
  void put(const std::string& at, const PathSegment& s) {
    put(at, s.kind);
    put(at + ".from_s", s.from_s);
    put(at + ".to_s", s.to_s);
    put(at + ".every_s", s.every_s);
    put(at + ".displacement", s.displacement);
    put(at + ".axis", s.axis);
    put(at + ".angle", s.angle);
    put(at + ".radius_m", s.radius);
    put(at + ".period_s", s.period_s);
    put(at + ".along", s.along);
    put(at + ".across", s.across);
    put(at + ".amplitude_m", s.amplitude);
    put(at + ".wavenumber", s.wavenumber);
  }
  void put(const std::string& at, const OperatorSpec& o) {
    put(at + ".mass_kg", o.mass_kg);
    put(at + ".damping_n_s_m", o.damping_n_s_m);
    put(at + ".stiffness_n_m", o.stiffness_n_m);
    put(at + ".inertia_kg_m2", o.inertia_kg_m2);
    put(at + ".rotational_damping_n_m_s", o.rotational_damping_n_m_s);
    put(at + ".rotational_stiffness_n_m", o.rotational_stiffness_n_m);
  }
  void put(const std::string& at, const DeviceSpec& d) {
    put(at + ".kind", d.kind);
    put(at + ".degrees_of_freedom", d.degrees_of_freedom);
    put(at + ".rate_hz", d.rate_hz);
    put(at + ".force_limit_n", d.force_limit_n);
    put(at + ".torque_limit_n_m", d.torque_limit_n_m);
    put(at + ".force_rate_limit_n_s", d.force_rate_limit_n_s);
    put(at + ".power_limit_w", d.power_limit_w);
    put(at + ".speed_limit_m_s", d.speed_limit_m_s);
    put(at + ".mass_kg", d.mass_kg);
    put(at + ".damping_n_s_m", d.damping_n_s_m);
    put(at + ".friction_n", d.friction_n);
    put(at + ".position_resolution_m", d.position_resolution_m);
    put(at + ".path", d.path);
    put(at + ".operator", d.operator_model);
  }
  void put(const std::string& at, const CouplingSettings& c) {
    put(at + ".stiffness_n_m", c.stiffness_n_m);
    put(at + ".damping_n_s_m", c.damping_n_s_m);
    put(at + ".rotational_stiffness_n_m", c.rotational_stiffness_n_m);
    put(at + ".rotational_damping_n_m_s", c.rotational_damping_n_m_s);
    put(at + ".ramp_s", c.ramp_s);
  }
  void put(const std::string& at, const UserSpec& u) {
    put(at + ".name", u.name);
    put(at + ".proxy", index(u.proxy));
    put(at + ".joins_late", u.joins_late);
    put(at + ".selection", u.selection);
    put(at + ".box_half_m", u.box_half_m);
    put(at + ".contact_depth", u.contact_depth);
    put(at + ".budget_ratio", u.budget_ratio);
    put(at + ".coupling", u.coupling);
    put(at + ".device", u.device);
  }
  void put(const std::string& at, const EngineSettings& e) {
    put(at + ".engine", e.name);
    put(at + ".preset", e.preset);
    put(at + ".iterations", e.iterations);
    put(at + ".substeps", e.substeps);
    put(at + ".longest_substep_s", e.longest_substep_s);
    put(at + ".gravity", e.gravity);
    put(at + ".length_unit_m", e.length_unit_m);
  }
  void put(const std::string& at, const DelaySettings& d) {
    put(at + ".up_s", d.up_s);
    put(at + ".down_s", d.down_s);
    put(at + ".from_device_s", d.from_device_s);
    put(at + ".to_device_s", d.to_device_s);
    put(at + ".jitter_s", d.jitter_s);
    put(at + ".loss_ratio", d.loss_ratio);
    put(at + ".seed", d.seed);
  }
  void put(const std::string& at, const Settings& s) {
    put(at + ".h_s", s.h_s);
    put(at + ".ratio", to_text(s.ratio_bounds()));
    put(at + ".settle.duration_s", s.settle_s);
    put(at + ".settle.step_s", s.settle_step_s);
    put(at + ".users", s.users);
    put(at + ".mode", s.mode);
    put(at + ".absent", s.absent);
    put(at + ".presence", to_text(s.presence));
    put(at + ".scheme", s.scheme);
    put(at + ".paper.device_force_in_world", s.paper.device_force_in_world);
    put(at + ".paper.device_impulse_threshold_n_s", s.paper.device_impulse_threshold_n_s);
    put(at + ".delay", s.delay);
    put(at + ".passivity", s.passivity);
    put(at + ".deadband", s.deadband);
    put(at + ".disable", fmt::format("[{}]", fmt::join(disabled_names(s.disabled), ", ")));
    put(at + ".world", s.world);
    put(at + ".haptic", s.haptic);
  }

 private:
  std::vector<NamedSetting> list_;
};

}  // namespace

std::vector<NamedSetting> agreed_settings(const Scene& scene) {
  Lister list;
  list.put("name", scene.name);
  list.put("settings", scene.settings);
  list.put("users", scene.users);
  Hasher bodies;
  bodies.add(scene.meshes, scene.bodies, scene.initial);
  list.put("bodies", fmt::format("{:016x}", bodies.value()));
  return std::move(list).take();
}

std::vector<NamedSetting> settings_of(const Body& body) {
  Lister list;
  list.put("name", body.name);
  list.put("shape", body.shape.kind);
  list.put("half_extents_m", body.shape.half_extents);
  list.put("radius_m", body.shape.radius);
  list.put("half_length_m", body.shape.half_length);
  list.put("friction", body.material.friction);
  list.put("restitution", body.material.restitution);
  list.put("mass_kg", body.mass);
  list.put("inertia_kg_m2", body.inertia);
  list.put("gravity", body.gravity);
  list.put("rotates", body.rotates);
  return std::move(list).take();
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
  if (different.size() <= named) return fmt::format("{}", fmt::join(different, "; "));
  const std::size_t more = different.size() - named;
  different.resize(named);
  return fmt::format("{}; and {} more", fmt::join(different, "; "), more);
}

std::uint64_t settings_hash(const Scene& scene) {
  Hasher hash;
  for (const NamedSetting& setting : agreed_settings(scene)) hash.add(setting.name, setting.value);
  return hash.value();
}

}  // namespace subworld
