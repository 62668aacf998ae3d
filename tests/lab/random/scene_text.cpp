#include "lab/random/scene_text.hpp"

#include "io/results/results.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"
#include "model/scene/scene_reader.hpp"
#include "model/settings/settings.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numbers>

namespace subworld {

namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr const char* kShapeWords[] = {"sphere", "box", "capsule", "cylinder", "plane", "convex", "mesh"};

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
  [[nodiscard]] std::string str() const { return fmt::format("{{{}}}", joined(entries_, ", ")); }

 private:
  std::vector<std::string> entries_;
};

class NamedMaterials {
 public:
  explicit NamedMaterials(const Scene& scene) {
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
    case ShapeKind::compound:  // the generator makes none
      break;
  }
}

/// Keys that a body and a user's own proxy have in common.
void add_body(Map& map, const Scene& scene, const Body& body, const NamedMaterials& materials) {
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

/// The settings of a group of keys (model/scene_reader), as a map on one line.
std::string settings_map(const std::string& group, Settings& settings, UserSpec& user) {
  std::vector<std::string> entries;
  for (const std::string_view key : keys_in(group)) {
    const std::string full = group + std::string(key);
    const Setting* const setting = find_setting(full);
    const std::string value = setting != nullptr ? value_text(*setting, settings, user).value_or("")
                                                 : settings_map(full + ".", settings, user);
    if (full != "users" && !value.empty() && value != "{}") entries.push_back(fmt::format("{}: {}", key, value));
  }
  return fmt::format("{{{}}}", joined(entries, ", "));
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

std::string user_text(const Scene& scene, const UserSpec& user, const NamedMaterials& materials) {
  Map proxy;
  if (user.own_proxy) {
    add_body(proxy, scene, scene.body(user.proxy), materials);
  } else {
    proxy.add("body", plain_name(scene.body(user.proxy).name));
  }
  std::string lines = fmt::format("  - name: {}\n    proxy: {}\n", user.name, proxy.str());
  if (user.joins_late) lines += "    joins: after_settling\n";
  Settings none;
  UserSpec copy = user;
  for (const std::string_view key : keys_in("users.")) {
    const std::string full = "users." + std::string(key);
    const Setting* const setting = find_setting(full);
    std::string value =
        setting != nullptr ? value_text(*setting, none, copy).value_or("") : settings_map(full + ".", none, copy);
    if (value == "{}") continue;
    if (key == "device") {
      value.pop_back();
      std::vector<std::string> path;
      for (const PathSegment& s : user.device.path) path.push_back(segment_map(s).str());
      value += fmt::format(", path: [{}]}}", joined(path, ", "));
    }
    lines += fmt::format("    {}: {}\n", key, value);
  }
  return lines;
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
  const NamedMaterials materials(scene);
  std::string lines = fmt::format("name: {}\n", scene.name);
  if (!scene.description.empty()) {
    std::string escaped;
    for (const char c : scene.description) escaped += c == '\'' ? "''" : c == '\n' ? " " : std::string(1, c);
    lines += fmt::format("description: '{}'\n", escaped);
  }
  Settings settings = scene.settings;
  UserSpec none;
  lines += fmt::format("settings: {}\n", settings_map("", settings, none)) + materials.str();
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
