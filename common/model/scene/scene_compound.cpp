#include "model/scene/scene_reader.hpp"
#include "model/shapes/compound.hpp"
#include "model/shapes/mass_properties.hpp"
#include "model/shapes/shape_extent.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace subworld {

namespace {

constexpr int kMostSides = 64;
constexpr double kThinnestWall = 0.01;  ///< of the radius: a thinner side is none in single precision
const std::initializer_list<std::string_view> kPartKeys = {
    "shape", "size_m", "radius_m", "top_radius_m", "length_m", "wall_m",        "sides",      "file",
    "scale", "up",     "parts",    "material",     "mass_kg",  "density_kg_m3", "position_m", "rotation"};

/// One side of a tube, along x: from the hole's radius at each end to a plane that is `wall` farther out than both.
Mesh side_of_tube(double radius, double top_radius, double wall, double half_length, int sides) {
  const double slope = std::tan(M_PI / sides);
  const double outer = std::max(radius, top_radius) + wall;
  Mesh mesh;
  for (const auto& [x, z] :
       {std::pair{radius, -half_length}, {top_radius, half_length}, {outer, -half_length}, {outer, half_length}})
    for (const double side : {-1.0, 1.0}) mesh.vertices.emplace_back(x, side * slope * x, z);
  return mesh;
}

}  // namespace

void read_inertia(const YamlMap& map, MassProperties& whole) {
  if (const auto at = map.find("centre_of_mass_m")) {
    whole.centre = at->vec3(kPlace);
    if (!map.has("inertia_kg_m2")) at->fail("the moments about it are needed too; add inertia_kg_m2");
  }
  const auto at = map.find("inertia_kg_m2");
  if (!at) return;
  if (!map.has("mass_kg")) at->fail("needs the mass of the whole; add mass_kg");
  whole.mass = map.at("mass_kg").number(kMass);
  const std::vector<double> xx_yy_zz_xy_xz_yz = at->numbers(6);
  const auto& i = xx_yy_zz_xy_xz_yz;
  whole.inertia << i[0], i[3], i[4], i[3], i[1], i[5], i[4], i[5], i[2];
  const Vec3 moments = principal_axes(whole.inertia).moments;
  if (of_a_body(moments)) return;
  at->fail(
      fmt::format("is of no body: its principal moments are {:.4g}, {:.4g} and {:.4g} kg m2, and {}; check the values, "
                  "in the order "
                  "xx, yy, zz, xy, xz, yz",
                  moments.x(), moments.y(), moments.z(),
                  moments.minCoeff() > 0.0 ? "none may exceed the sum of the others" : "all must be positive"));
}

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
  double top_radius = radius;
  if (const auto top = part.find("top_radius_m")) top_radius = top->number(kLength);
  const double thinnest = kThinnestWall * std::max(radius, top_radius);
  const double wall = part.at("wall_m").number({.least = thinnest, .most = kLength.most});
  int sides = 24;
  part.read("sides", sides, 3, kMostSides);
  Mesh mesh = side_of_tube(radius, top_radius, wall, 0.5 * part.at("length_m").number(kLength), sides);
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
  const Material material = read_material(map, materials_);
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
      const Material own = part.has("material") ? read_material(part, materials_) : material;
      for (const Pose& place : places) {
        volume += solid.volume;
        parts.push_back({{solid.shape, frame * place, own}, mass, mass * solid.inertia_per_kg});
      }
    });
  }
  faults.raise();
  if (parts.empty()) list.fail("a compound body needs a part; add one, such as {shape: box, size_m: [1, 1, 1]}");
  if (parts.size() > std::size_t{kMostParts})
    list.fail(fmt::format("{} parts; a body has at most {}", parts.size(), kMostParts));
  MassProperties given = total_of(parts);
  read_inertia(map, given);
  Compound whole = assemble(parts, scene_.meshes, given);
  SolidShape solid = add_compound(std::move(whole), volume);
  if (whole_has_mass) solid.mass = 0.0;
  return solid;
}

SolidShape BodyReader::add_compound(Compound whole, double volume) {
  SolidShape solid;
  solid.frame = whole.frame;
  solid.volume = volume;
  solid.mass = whole.mass;
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
