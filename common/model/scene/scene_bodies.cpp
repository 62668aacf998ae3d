#include "model/scene/scene_reader.hpp"
#include "model/shapes/nearest.hpp"
#include "model/trigonometry.hpp"

#include <fmt/core.h>

namespace subworld {

namespace {

constexpr Limits kSpeed{.least = -1e6, .most = 1e6};                                                   // m/s, rad/s
constexpr Limits kFriction{.least = 0.0, .most = 100.0}, kTurningFriction{.least = 0.0, .most = 1e3};  // m
constexpr Limits kSide{.least = 1e-6, .most = 1e6};                                                    // m

/// Keys of bodies and proxies alike, and some more.
std::vector<std::string_view> keys_and(std::initializer_list<std::string_view> own) {
  std::vector<std::string_view> keys{"shape",
                                     "size_m",
                                     "radius_m",
                                     "length_m",
                                     "file",
                                     "scale",
                                     "up",
                                     "parts",
                                     "decompose",
                                     "material",
                                     "mass_kg",
                                     "density_kg_m3",
                                     "inertia_kg_m2",
                                     "centre_of_mass_m",
                                     "position_m",
                                     "rotation",
                                     "velocity_m_s",
                                     "angular_velocity_rad_s",
                                     "gravity",
                                     "rotates",
                                     "collision_group"};
  keys.insert(keys.end(), own);
  return keys;
}
const std::vector<std::string_view> kBodyKeys =
    keys_and({"name", "fixed", "wall_m", "at_rest", "repeat", "surface_velocity_m_s", "surface_turn_rad_s"});
const std::vector<std::string_view> kProxyKeys = keys_and({"body"});

/// In place of a shape with an error, so that a mass follows from it without another error.
const SolidShape kUnread{.volume = 1.0, .inertia_per_kg = Vec3::Ones()};
/// The mass of one with parts is theirs.
SolidShape unread(const YamlMap& map) {
  SolidShape solid = kUnread;
  if (map.has("parts") && !map.has("mass_kg") && !map.has("density_kg_m3")) solid.mass = 1.0;
  return solid;
}

const Material& find_material(const YamlValue& value, const Materials& materials) {
  const std::string name = value.text();
  if (const auto known = materials.find(name); known != materials.end()) return known->second;
  std::vector<std::string_view> names;
  for (const auto& [known, unused] : materials) names.push_back(known);
  const std::string_view near = nearest(name, names);
  value.fail(near.empty() ? fmt::format("unknown material \"{}\"; describe it under \"materials\"", name)
                          : fmt::format("unknown material \"{}\"; did you mean \"{}\"?", name, near));
}

MaterialPair read_pair(const YamlValue& item, const Materials& materials) {
  Faults faults;
  const YamlMap map(item, {"a", "b", "friction", "restitution", "rolling_friction_m", "spinning_friction_m"}, faults);
  MaterialPair pair;
  faults.collect([&] { pair.a = find_material(map.at("a"), materials).number; });
  faults.collect([&] { pair.b = find_material(map.at("b"), materials).number; });
  bool any = false;
  const auto read = [&](const char* key, std::optional<double>& target, const Limits& limits) {
    faults.collect([&] {
      const auto value = map.find(key);
      any = any || value;
      if (value) target = value->number(limits);
    });
  };
  read("friction", pair.friction, kFriction);
  read("restitution", pair.restitution, kUnit);
  read("rolling_friction_m", pair.rolling_friction, kTurningFriction);
  read("spinning_friction_m", pair.spinning_friction, kTurningFriction);
  faults.raise();
  if (!any) item.fail("add friction, restitution, rolling_friction_m or spinning_friction_m");
  return pair;
}

}  // namespace

Quat read_rotation(const YamlMap& map) {
  const auto value = map.find("rotation");
  if (!value) return Quat::Identity();
  const YamlMap rotation(*value, {"axis", "angle_deg"});
  const Vec3 axis = rotation.at("axis").direction();
  return rotation_deg(axis, rotation.at("angle_deg").number({.least = -360.0, .most = 360.0}));
}

Materials read_materials(const YamlValue& value, Faults& faults) {
  Materials materials;
  for (const YamlValue::Named& entry : value.entries()) {
    Material& material = materials[entry.key];
    faults.collect([&] {
      const YamlMap map(entry.value, {"friction", "restitution", "rolling_friction_m", "spinning_friction_m"}, faults);
      faults.collect([&] { map.read("friction", material.friction, kFriction); });
      faults.collect([&] { map.read("restitution", material.restitution, kUnit); });
      faults.collect([&] { map.read("rolling_friction_m", material.rolling_friction, kTurningFriction); });
      faults.collect([&] { map.read("spinning_friction_m", material.spinning_friction, kTurningFriction); });
    });
  }
  return materials;
}

std::vector<MaterialPair> read_pairs(const YamlValue& list, Materials& materials) {
  std::vector<MaterialPair> pairs;
  std::uint32_t number = 0;
  for (auto& [name, material] : materials) material.number = ++number;
  Faults faults;
  for (const YamlValue& item : list.items()) {
    faults.collect([&] {
      const MaterialPair pair = read_pair(item, materials);
      const auto is_same = [&](const MaterialPair& other) {
        return std::minmax(other.a, other.b) == std::minmax(pair.a, pair.b);
      };
      if (std::ranges::any_of(pairs, is_same)) item.fail("these two materials are a pair already; remove one");
      pairs.push_back(pair);
    });
  }
  faults.raise();
  return pairs;
}

Material read_material(const YamlMap& map, const Materials& materials) {
  const auto value = map.find("material");
  return value ? find_material(*value, materials) : Material{};
}

void BodyReader::read_bodies(const YamlValue& list) {
  Faults faults;
  for (const YamlValue& body : list.items()) faults.collect([&] { read_body(body); });
  faults.raise();
  complete_ = true;
}

void BodyReader::read_body(const YamlValue& value) {
  Faults faults;
  const YamlMap map(value, kBodyKeys, faults);
  bool bin = false;
  faults.collect([&] { bin = map.at("shape").text() == "bin"; });
  faults.collect([&] { bin ? read_bin(map) : read_solid(map); });
  faults.raise();
}

void BodyReader::read_solid(const YamlMap& map) {
  Faults faults;
  std::string name;
  faults.collect([&] { name = map.at("name").name(); });
  SolidShape solid = unread(map);
  std::optional<Layout> layout;
  bool fixed = false;
  const bool known = faults.collect([&] { map.read("fixed", fixed); });
  faults.collect([&] {
    solid = read_shape(map, fixed || !known);
    if (map.has("repeat")) layout = read_repeat(map, solid);
  });
  Template made;
  faults.collect([&] { made = read_template(map, solid); });
  faults.raise();
  if (!layout) {
    require_room(map.whole(), 1);
    add(map.at("name"), name, made, {});
    return;
  }
  for (std::size_t i = 0; i < layout->size(); ++i) {
    add(map.at("name"), fmt::format("{}/{}", name, i), made, (*layout)[i]);
  }
}

/// Four walls around an inner area, standing on the group's position.
void BodyReader::read_bin(const YamlMap& map) {
  Faults faults;
  faults.collect([&] { forbid_other_measures(map, "bin"); });
  faults.collect([&] { map.forbid({"repeat", "rotation"}, "a bin is four walls along the axes"); });
  faults.collect([&] {
    bool fixed = false;
    map.read("fixed", fixed);
    if (!fixed) map.at("shape").fail("a bin cannot move; add \"fixed: true\"");
  });
  Vec3 inner;
  double wall = 0.0;
  faults.collect([&] { inner = map.at("size_m").vec3(kSide); });
  faults.collect([&] { wall = map.at("wall_m").number(kSide); });
  faults.collect([&] { (void)map.at("name").name(); });
  faults.raise();
  require_room(map.whole(), 4);
  int index = 0;
  for (const int axis : {0, 1}) {
    for (const double side : {-1.0, 1.0}) {
      SolidShape solid;
      solid.shape.kind = ShapeKind::box;
      // The walls across x extend over the corners.
      solid.shape.half_extents = 0.5 * inner;
      solid.shape.half_extents[axis] = 0.5 * wall;
      if (axis == 0) solid.shape.half_extents.y() += wall;
      Pose offset;
      offset.position[axis] = side * 0.5 * (inner[axis] + wall);
      offset.position.z() = 0.5 * inner.z();
      add(map.at("name"), fmt::format("{}/{}", map.at("name").name(), index++), read_template(map, solid), offset);
    }
  }
}

BodyReader::Template BodyReader::read_template(const YamlMap& map, const SolidShape& solid) {
  Template made;
  Body& body = made.body;
  made.frame = solid.frame;
  body.shape = solid.shape;
  Faults faults;
  const auto read_vector = [&](std::string_view key, Vec3& target, const Limits& limits) {
    faults.collect([&] {
      if (const auto value = map.find(key)) target = value->vec3(limits);
    });
  };
  faults.collect([&] { body.material = read_material(map, materials_); });
  faults.collect([&] {
    read_mass(map, solid, body);
    if (!body.fixed()) return map.forbid({"surface_velocity_m_s", "surface_turn_rad_s"}, "only a fixed body has them");
    map.forbid({"velocity_m_s", "angular_velocity_rad_s", "gravity", "rotates", "at_rest"}, "the body is fixed");
    body.gravity = false;
  });
  faults.collect([&] {
    if (const auto group = map.find("collision_group"))
      body.group = groups_.try_emplace(group->name(), groups_.size() + 1).first->second;
  });
  faults.collect([&] { map.read("gravity", body.gravity); });
  faults.collect([&] { map.read("rotates", body.rotates); });
  faults.collect([&] { map.read("at_rest", body.at_rest); });
  faults.collect([&] {
    if (body.at_rest) map.forbid({"velocity_m_s", "angular_velocity_rad_s"}, "the body is at rest");
    if (!body.rotates) map.forbid({"angular_velocity_rad_s"}, "the body does not rotate");
  });
  read_vector("position_m", made.state.position, kPlace);
  read_vector("velocity_m_s", made.state.linear_velocity, kSpeed);
  read_vector("angular_velocity_rad_s", made.state.angular_velocity, kSpeed);
  read_vector("surface_velocity_m_s", body.surface_velocity, kSpeed);
  read_vector("surface_turn_rad_s", body.surface_turn, kSpeed);
  faults.collect([&] { made.state.orientation = read_rotation(map); });
  faults.raise();
  return made;
}

void BodyReader::read_mass(const YamlMap& map, const SolidShape& solid, Body& body) const {
  if (map.has("fixed") && map.at("fixed").flag()) return map.forbid({"mass_kg", "density_kg_m3"}, "the body is fixed");
  if (solid.mass > 0.0) {
    body.mass = solid.mass;
  } else {
    body.mass = map.one_of({"mass_kg", "density_kg_m3"}) == 0 ? map.at("mass_kg").number(kMass)
                                                              : map.at("density_kg_m3").number(kDensity) * solid.volume;
  }
  body.inertia = body.mass * solid.inertia_per_kg;
  if (!(body.inertia.minCoeff() > 0.0) || !body.inertia.allFinite()) {
    map.whole().fail("size and mass give a moment of inertia that is not a positive number; check both");
  }
}

BodyId BodyReader::add(const YamlValue& place, const std::string& name, const Template& made, const Pose& offset) {
  const auto id = static_cast<BodyId>(scene_.bodies.size());
  if (!names_.try_emplace(name, id).second) place.fail(fmt::format("there is another body \"{}\"; rename one", name));
  Body body = made.body;
  body.id = id;
  body.name = name;
  BodyState state = made.state;
  const Quat placed = offset.orientation * made.state.orientation;
  state.position = made.state.position + offset.position + placed * made.frame.position;
  state.orientation = (placed * made.frame.orientation).normalized();
  if (!finite(state)) place.fail("the position is not a finite number; check positions and the mesh's scale");
  scene_.bodies.push_back(std::move(body));
  scene_.initial.push_back(state);
  return id;
}

BodyId BodyReader::read_proxy(const YamlValue& value, const std::string& user) {
  Faults faults;
  const YamlMap map(value, kProxyKeys, faults);
  const auto at = map.find("body");
  if (!at) {
    SolidShape solid = unread(map);
    Template made;
    faults.collect([&] { solid = read_shape(map, false); });
    faults.collect([&] { made = read_template(map, solid); });
    faults.raise();
    require_room(value, 1);
    return add(value, user + "/proxy", made, {});
  }
  faults.raise();
  for (const std::string_view key : kProxyKeys) {
    if (key != "body") map.forbid({key}, "the proxy is an existing body");
  }
  const std::string name = at->text();
  if (!complete_ && !names_.contains(name)) return add(value, user + "/proxy", {}, {});
  const BodyId known = find_body(*at);
  if (scene_.body(known).fixed()) {
    at->fail(fmt::format("\"{}\" is fixed, a proxy must move; give it a mass or choose another body", name));
  }
  return known;
}

BodyId BodyReader::find_body(const YamlValue& name) const {
  const std::string text = name.text();
  if (const auto known = names_.find(text); known != names_.end()) return known->second;
  std::vector<std::string_view> all;
  for (const Body& body : scene_.bodies) all.push_back(body.name);
  const std::string_view near = nearest(text, all);
  name.fail(fmt::format("no body is named \"{}\"{}", text,
                        near.empty() ? "; name one of \"bodies\"" : fmt::format("; did you mean \"{}\"?", near)));
}

std::vector<BodyId> BodyReader::find_copies(const YamlValue& name) const {
  const std::string text = name.text();
  std::vector<BodyId> copies;
  for (auto next = names_.find(text + "/0"); next != names_.end();
       next = names_.find(fmt::format("{}/{}", text, copies.size())))
    copies.push_back(next->second);
  if (copies.empty()) (void)find_body(name);
  if (copies.size() < 2) name.fail("needs a body with \"repeat\" and at least two copies");
  return copies;
}

}  // namespace subworld
