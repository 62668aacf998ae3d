#include "lab/random/scene_text.hpp"

#include "io/results.hpp"
#include "model/error.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>

namespace subworld {

namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr const char* kShapeWords[] = {"sphere", "box", "capsule", "cylinder", "plane", "convex", "mesh"};
constexpr const char* kModeWords[] = {"lockstep", "realtime"};
constexpr const char* kPassivityWords[] = {"automatic", "on", "off"};
constexpr const char* kSelectionWords[] = {"box", "contacts", "budget"};
constexpr const char* kKindWords[] = {"impedance", "admittance"};

template <class E>
const char* word(const char* const* words, E value) {
  return words[static_cast<std::size_t>(value)];
}

std::string text(const Vec3& v) { return fmt::format("[{}, {}, {}]", v.x(), v.y(), v.z()); }
const char* text(bool flag) { return flag ? "true" : "false"; }

std::string plain_name(std::string name) {
  std::ranges::replace(name, '/', '.');
  return name;
}

/// Keys and values of one map on one line.
class Map {
 public:
  template <class T>
  Map& add(const char* key, const T& value) {
    entries_.push_back(fmt::format("{}: {}", key, value));
    return *this;
  }
  Map& add(const char* key, const Vec3& value) { return add(key, text(value)); }
  Map& add(const char* key, bool value) { return add(key, std::string(text(value))); }
  Map& add(const char* key, const Map& value) { return add(key, value.str()); }
  [[nodiscard]] std::string str() const { return fmt::format("{{{}}}", fmt::join(entries_, ", ")); }

 private:
  std::vector<std::string> entries_;
};

class Materials {
 public:
  explicit Materials(const Scene& scene) {
    for (const Body& body : scene.bodies) {
      if (find(body.material) == known_.size()) known_.push_back(body.material);
    }
  }
  [[nodiscard]] std::string name(const Material& m) const { return fmt::format("m{}", find(m)); }
  [[nodiscard]] std::string str() const {
    std::string lines = "materials:\n";
    for (const Material& m : known_) {
      lines +=
          fmt::format("  {}: {}\n", name(m), Map().add("friction", m.friction).add("restitution", m.restitution).str());
    }
    return lines;
  }

 private:
  [[nodiscard]] std::size_t find(const Material& m) const {
    const auto same = [&](const Material& k) { return k.friction == m.friction && k.restitution == m.restitution; };
    return static_cast<std::size_t>(std::ranges::find_if(known_, same) - known_.begin());
  }
  std::vector<Material> known_;
};

std::string mesh_name(const Scene& scene, std::uint32_t mesh) { return fmt::format("{}_{}.obj", scene.name, mesh); }

void add_shape(Map& map, const Scene& scene, const Shape& shape) {
  map.add("shape", word(kShapeWords, shape.kind));
  switch (shape.kind) {
    case ShapeKind::box:
      map.add("size_m", Vec3(2.0 * shape.half_extents));
      break;
    case ShapeKind::sphere:
      map.add("radius_m", shape.radius);
      break;
    case ShapeKind::capsule:
    case ShapeKind::cylinder:
      map.add("radius_m", shape.radius).add("length_m", 2.0 * shape.half_length);
      break;
    case ShapeKind::convex:
    case ShapeKind::mesh:
      map.add("file", mesh_name(scene, shape.mesh));
      break;
    case ShapeKind::plane:
      break;
  }
}

/// Keys that a body and a user's own proxy have in common.
void add_body(Map& map, const Scene& scene, const Body& body, const Materials& materials) {
  const BodyState& at = scene.initial[index(body.id)];
  add_shape(map, scene, body.shape);
  map.add("material", materials.name(body.material));
  if (!body.fixed()) map.add("mass_kg", body.mass);
  map.add("position_m", at.position);
  const Eigen::AngleAxisd turn(at.orientation);
  if (turn.angle() != 0.0)
    map.add("rotation", Map().add("axis", Vec3(turn.axis())).add("angle_deg", kDegrees * turn.angle()));
  if (body.fixed()) return;
  if (!at.linear_velocity.isZero(0.0)) map.add("velocity_m_s", at.linear_velocity);
  if (!at.angular_velocity.isZero(0.0)) map.add("angular_velocity_rad_s", at.angular_velocity);
  if (!body.gravity) map.add("gravity", false);
  if (!body.rotates) map.add("rotates", false);
}

Map engine_map(const EngineSettings& engine) {
  Map map;
  map.add("engine", engine.name).add("preset", engine.preset);
  if (engine.iterations) map.add("iterations", *engine.iterations);
  if (engine.substeps) map.add("substeps", *engine.substeps);
  if (engine.longest_substep_s) map.add("longest_substep_s", *engine.longest_substep_s);
  if (engine.length_unit_m != 1.0) map.add("length_unit_m", engine.length_unit_m);
  return map;
}

std::string settings_text(const Settings& s) {
  std::string lines = "settings:\n";
  const auto line = [&](const char* key, const auto& value) { lines += fmt::format("  {}: {}\n", key, value); };
  line("h_s", s.h_s);
  if (s.adapts_ratio()) {
    line("ratio", fmt::format("[{}, {}]", s.ratio, s.ratio_most));
  } else {
    line("ratio", s.ratio);
  }
  line("duration_s", s.duration_s);
  line("settle", Map().add("duration_s", s.settle_s).add("step_s", s.settle_step_s).str());
  line("mode", word(kModeWords, s.mode));
  line("scheme", s.scheme);
  if (s.delay.any()) {
    const DelaySettings& d = s.delay;
    line("delay", Map()
                      .add("up_s", d.up_s)
                      .add("down_s", d.down_s)
                      .add("from_device_s", d.from_device_s)
                      .add("to_device_s", d.to_device_s)
                      .add("jitter_s", d.jitter_s)
                      .add("loss_ratio", d.loss_ratio)
                      .add("seed", d.seed)
                      .str());
  }
  line("passivity", word(kPassivityWords, s.passivity));
  line("gravity_m_s2", text(s.world.gravity));
  line("world", engine_map(s.world).str());
  line("haptic", engine_map(s.haptic).str());
  line("paper", Map()
                    .add("device_force_in_world", s.paper.device_force_in_world)
                    .add("device_impulse_threshold_n_s", s.paper.device_impulse_threshold_n_s)
                    .str());
  return lines;
}

Map segment_map(const PathSegment& s) {
  Map map;
  const std::string during = fmt::format("[{}, {}]", s.from_s, s.to_s);
  switch (s.kind) {
    case PathSegment::Kind::move:
      map.add("move", s.displacement).add("during_s", during);
      break;
    case PathSegment::Kind::turn:
      map.add("turn", Map().add("axis", s.axis).add("angle_deg", kDegrees * s.angle)).add("during_s", during);
      break;
    case PathSegment::Kind::circle:
      map.add("circle", Map().add("radius_m", s.radius).add("period_s", s.period_s).add("axis", s.axis));
      map.add("from_s", s.from_s);
      if (std::isfinite(s.to_s)) map.add("to_s", s.to_s);
      break;
    case PathSegment::Kind::wave:
      map.add("wave", Map()
                          .add("along", s.along)
                          .add("across", s.across)
                          .add("amplitude_m", s.amplitude)
                          .add("wavenumber_rad_m", s.wavenumber));
      map.add("from_s", s.from_s);
      break;
  }
  if (s.every_s > 0.0) map.add("every_s", s.every_s);
  return map;
}

std::string device_text(const DeviceSpec& d) {
  std::string lines = "    device:\n";
  const auto line = [&](const char* key, const auto& value) { lines += fmt::format("      {}: {}\n", key, value); };
  line("kind", word(kKindWords, d.kind));
  line("degrees_of_freedom", d.degrees_of_freedom);
  line("rate_hz", d.rate_hz);
  line("force_limit_n", d.force_limit_n);
  line("torque_limit_n_m", d.torque_limit_n_m);
  if (d.force_rate_limit_n_s) line("force_rate_limit_n_s", *d.force_rate_limit_n_s);
  if (d.power_limit_w) line("power_limit_w", *d.power_limit_w);
  line("speed_limit_m_s", d.speed_limit_m_s);
  line("mass_kg", d.mass_kg);
  line("damping_n_s_m", d.damping_n_s_m);
  line("friction_n", d.friction_n);
  line("position_resolution_m", d.position_resolution_m);
  if (!d.path.empty()) lines += "      path:\n";
  for (const PathSegment& s : d.path) lines += fmt::format("        - {}\n", segment_map(s).str());
  if (d.operator_model) {
    line("operator", Map()
                         .add("mass_kg", d.operator_model->mass_kg)
                         .add("damping_n_s_m", d.operator_model->damping_n_s_m)
                         .add("stiffness_n_m", d.operator_model->stiffness_n_m)
                         .add("inertia_kg_m2", d.operator_model->inertia_kg_m2)
                         .add("rotational_damping_n_m_s_rad", d.operator_model->rotational_damping_n_m_s)
                         .add("rotational_stiffness_n_m_rad", d.operator_model->rotational_stiffness_n_m)
                         .str());
  }
  return lines;
}

std::string user_text(const Scene& scene, const UserSpec& user, const Materials& materials) {
  Map proxy;
  if (user.own_proxy) {
    add_body(proxy, scene, scene.body(user.proxy), materials);
  } else {
    proxy.add("body", plain_name(scene.body(user.proxy).name));
  }
  const CouplingSettings& k = user.coupling;
  std::string lines = fmt::format("  - name: {}\n    proxy: {}\n", user.name, proxy.str());
  if (user.joins_late) lines += "    joins: after_settling\n";
  lines += fmt::format("    coupling: {}\n", Map()
                                                 .add("stiffness_n_m", k.stiffness_n_m)
                                                 .add("damping_n_s_m", k.damping_n_s_m)
                                                 .add("rotational_stiffness_n_m_rad", k.rotational_stiffness_n_m)
                                                 .add("rotational_damping_n_m_s_rad", k.rotational_damping_n_m_s)
                                                 .add("ramp_s", k.ramp_s)
                                                 .str());
  lines += fmt::format("    selection: {}\n    box_half_m: {}\n    contact_depth: {}\n    budget_ratio: {}\n",
                       word(kSelectionWords, user.selection), user.box_half_m, user.contact_depth, user.budget_ratio);
  return lines + device_text(user.device);
}

bool own_proxy(const Scene& scene, BodyId id) {
  return std::ranges::any_of(scene.users, [&](const UserSpec& u) { return u.own_proxy && u.proxy == id; });
}

void write_file(const std::string& path, const std::string& content) {
  std::ofstream file(path);
  file << content;
  file.close();
  if (!file) throw Error(ExitCode::failed, fmt::format("{} cannot be written; check the folder", path));
}

std::string mesh_text(const Mesh& mesh) {
  std::string lines;
  // The reader has single precision, so further digits would be lost.
  for (const Vec3& v : mesh.vertices)
    lines += fmt::format("v {:.9g} {:.9g} {:.9g}\n", static_cast<float>(v.x()), static_cast<float>(v.y()),
                         static_cast<float>(v.z()));
  for (const auto& t : mesh.triangles) lines += fmt::format("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
  return lines;
}

}  // namespace

std::string scene_text(const Scene& scene) {
  const Materials materials(scene);
  std::string lines = fmt::format("name: {}\n", scene.name);
  if (!scene.description.empty()) {
    std::string escaped;
    for (const char c : scene.description) escaped += c == '\'' ? "''" : c == '\n' ? " " : std::string(1, c);
    lines += fmt::format("description: '{}'\n", escaped);
  }
  lines += settings_text(scene.settings) + materials.str();
  lines += std::ranges::all_of(scene.bodies, [&](const Body& b) { return own_proxy(scene, b.id); }) ? "bodies: []\n"
                                                                                                    : "bodies:\n";
  for (const Body& body : scene.bodies) {
    if (own_proxy(scene, body.id)) continue;
    Map map;
    map.add("name", plain_name(body.name));
    if (body.fixed()) map.add("fixed", true);
    add_body(map, scene, body, materials);
    lines += fmt::format("  - {}\n", map.str());
  }
  lines += "users:\n";
  for (const UserSpec& user : scene.users) lines += user_text(scene, user, materials);
  return lines;
}

std::string write_scene(const Scene& scene, const std::string& folder) {
  make_folder(folder);
  for (const Body& body : scene.bodies) {
    const ShapeKind kind = body.shape.kind;
    if (kind != ShapeKind::convex && kind != ShapeKind::mesh) continue;
    const std::uint32_t mesh = body.shape.mesh;
    write_file(folder + "/" + mesh_name(scene, mesh), mesh_text(scene.meshes[mesh]));
  }
  const std::string path = folder + "/" + scene.name + ".yaml";
  write_file(path, scene_text(scene));
  return path;
}

Scene as_written(const Scene& scene, const std::string& folder) {
  Scene read = load_scene(write_scene(scene, folder));
  keep_users(read, static_cast<int>(read.users.size()));
  return read;
}

}  // namespace subworld
