#include "model/scene/scene_reader.hpp"
#include "model/shapes/compound.hpp"
#include "model/shapes/shape_extent.hpp"

#include <fmt/core.h>

#include <cmath>

namespace subworld {

namespace {

constexpr std::size_t kMostParts = 256;
constexpr int kMostSides = 64;
constexpr double kThinnestWall = 0.01;  ///< of the radius: a thinner side is none in single precision
const std::initializer_list<std::string_view> kPartKeys = {
    "shape", "size_m", "radius_m", "length_m", "wall_m",        "sides",      "file",    "scale",
    "up",    "parts",  "material", "mass_kg",  "density_kg_m3", "position_m", "rotation"};

/// One side of a tube: between the planes at `inner` and at `outer` from the axis, along x.
Mesh side_of_tube(double inner, double outer, double half_length, int sides) {
  const double slope = std::tan(M_PI / sides);
  Mesh mesh;
  for (const double x : {inner, outer})
    for (const double side : {-1.0, 1.0})
      for (const double end : {-1.0, 1.0}) mesh.vertices.emplace_back(x, side * slope * x, end * half_length);
  return mesh;
}

}  // namespace

BodyReader::PartShape BodyReader::read_part_shape(const YamlMap& part) {
  const YamlValue at = part.at("shape");
  const std::string word = at.text();
  if (word == "compound") at.fail("a part has no parts; list them in the body");
  if (word == "plane" || word == "mesh" || word == "bin")
    at.fail(fmt::format("a {} is no part; use a box, sphere, capsule, cylinder, convex or tube", word));
  if (word != "tube") {
    PartShape whole{.solid = read_shape(part, false)};
    whole.places = {whole.solid.frame};
    return whole;
  }
  forbid_other_measures(part, word);
  const double radius = part.at("radius_m").number(kLength);
  const double wall = part.at("wall_m").number({.least = kThinnestWall * radius, .most = kLength.most});
  int sides = 24;
  part.read("sides", sides, 3, kMostSides);
  Mesh mesh = side_of_tube(radius, radius + wall, 0.5 * part.at("length_m").number(kLength), sides);
  PartShape tube{.solid = convex_solid(at, mesh)};
  tube.solid.shape = {.kind = ShapeKind::convex, .mesh = static_cast<std::uint32_t>(scene_.meshes.size())};
  scene_.meshes.push_back(std::move(mesh));
  for (int i = 0; i < sides; ++i) {
    const Pose turned{.orientation = Quat(Eigen::AngleAxisd(2.0 * M_PI * i / sides, Vec3::UnitZ()))};
    tube.places.push_back(turned * tube.solid.frame);
  }
  return tube;
}

SolidShape BodyReader::read_compound(const YamlMap& map, bool fixed) {
  const bool whole_has_mass = fixed || map.has("mass_kg") || map.has("density_kg_m3");
  const Material material = read_material(map);
  const YamlValue list = map.at("parts");
  std::vector<WeightedPart> parts;
  double volume = 0.0;
  Faults faults;
  for (const YamlValue& item : list.items()) {
    faults.collect([&] {
      const YamlMap part(item, kPartKeys);
      const auto [solid, places] = read_part_shape(part);
      Pose frame{.orientation = read_rotation(part)};
      if (const auto at = part.find("position_m")) frame.position = at->vec3(kPlace);
      double mass = solid.volume;
      if (whole_has_mass) {
        part.forbid({"mass_kg", "density_kg_m3"}, "the body has it, or is fixed");
      } else if (part.one_of({"mass_kg", "density_kg_m3"}) == 0) {
        mass = part.at("mass_kg").number(kMass) / static_cast<double>(places.size());
      } else {
        mass *= part.at("density_kg_m3").number(kDensity);
      }
      const Material own = part.has("material") ? read_material(part) : material;
      for (const Pose& place : places) {
        volume += solid.volume;
        parts.push_back({{solid.shape, frame * place, own}, mass, mass * solid.inertia_per_kg});
      }
    });
  }
  faults.raise();
  if (parts.empty()) list.fail("a compound body needs a part; add one, such as {shape: box, size_m: [1, 1, 1]}");
  if (parts.size() > kMostParts) list.fail(fmt::format("{} parts; a body has at most {}", parts.size(), kMostParts));
  Compound whole = assemble(parts, scene_.meshes);
  SolidShape solid;
  solid.frame = whole.frame;
  solid.volume = volume;
  solid.mass = whole_has_mass ? 0.0 : whole.mass;
  solid.inertia_per_kg = whole.inertia / whole.mass;
  solid.shape.kind = ShapeKind::compound;
  solid.shape.mesh = static_cast<std::uint32_t>(scene_.meshes.size());
  scene_.meshes.push_back(std::move(whole.mesh));
  const Box box = bounds(solid.shape, {}, scene_.meshes);
  solid.half_extents = box.upper.cwiseMax(-box.lower);
  solid.bounding_radius = bounding_radius(solid.shape, scene_.meshes);
  return solid;
}

}  // namespace subworld
