#include "model/hash.hpp"
#include "model/scene.hpp"

#include <bit>
#include <concepts>
#include <string_view>

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
  void put(const std::optional<T>& maybe) {
    put(maybe.has_value());
    if (maybe) put(*maybe);
  }
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
  void put(const PathSegment& s) {
    add(s.kind, s.from_s, s.to_s, s.every_s, s.displacement, s.axis, s.angle, s.radius, s.period_s, s.along, s.across,
        s.amplitude, s.wavenumber);
  }
  void put(const OperatorSpec& h) {
    add(h.mass_kg, h.damping_n_s_m, h.stiffness_n_m, h.inertia_kg_m2, h.rotational_damping_n_m_s,
        h.rotational_stiffness_n_m);
  }
  void put(const DeviceSpec& d) {
    add(d.kind, d.degrees_of_freedom, d.rate_hz, d.force_limit_n, d.torque_limit_n_m, d.force_rate_limit_n_s,
        d.power_limit_w, d.speed_limit_m_s, d.mass_kg, d.damping_n_s_m, d.friction_n, d.position_resolution_m, d.path,
        d.operator_model);
  }
  void put(const CouplingSettings& c) {
    add(c.stiffness_n_m, c.damping_n_s_m, c.rotational_stiffness_n_m, c.rotational_damping_n_m_s, c.ramp_s);
  }
  void put(const UserSpec& u) {
    add(u.name, u.proxy, u.joins_late, u.selection, u.box_half_m, u.contact_depth, u.budget_ratio, u.coupling,
        u.device);
  }
  void put(const EngineSettings& e) {
    add(e.name, e.preset, e.iterations, e.substeps, e.longest_substep_s, e.gravity, e.length_unit_m);
  }
  void put(const DelaySettings& d) {
    add(d.up_s, d.down_s, d.from_device_s, d.to_device_s, d.jitter_s, d.loss_ratio, d.seed);
  }
  void put(const Settings& s) {
    add(s.h_s, s.ratio, s.ratio_most, s.settle_s, s.settle_step_s, s.users, s.mode, s.scheme);
    add(s.paper.device_force_in_world, s.paper.device_impulse_threshold_n_s, s.delay, s.passivity, s.deadband,
        s.disabled, s.world, s.haptic);
  }

  void byte(unsigned char b) { value_ = hashed(value_, b); }

  std::uint64_t value_ = kHashSeed;
};

}  // namespace

std::uint64_t settings_hash(const Scene& scene) {
  Hasher hash;
  hash.add(scene.name, scene.meshes, scene.bodies, scene.initial, scene.users, scene.settings);
  return hash.value();
}

}  // namespace subworld
