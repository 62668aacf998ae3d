#include "model/scene/scene_reader.hpp"
#include "model/shapes/compound.hpp"
#include "model/shapes/shape_extent.hpp"

#include <fmt/core.h>

namespace subworld {

namespace {

constexpr std::size_t kMostParts = 256;
const std::initializer_list<std::string_view> kPartKeys = {
    "shape", "size_m", "radius_m", "length_m", "file",       "scale",
    "up",    "material", "mass_kg", "density_kg_m3", "position_m", "rotation"};

}  // namespace

SolidShape BodyReader::read_compound(const YamlMap& map, bool fixed) {
  const bool whole_has_mass = fixed || map.has("mass_kg") || map.has("density_kg_m3");
  const Material material = read_material(map);
  const std::vector<YamlValue> items = map.at("parts").items();
  if (items.empty()) map.at("parts").fail("a compound body needs a part; add one, such as {shape: box, size_m: [1, 1, 1]}");
  if (items.size() > kMostParts)
    map.at("parts").fail(fmt::format("{} parts; a body has at most {}", items.size(), kMostParts));
  std::vector<WeightedPart> parts;
  double volume = 0.0;
  Faults faults;
  for (const YamlValue& item : items) {
    faults.collect([&] {
      const YamlMap part(item, kPartKeys);
      if (part.at("shape").text() == "compound") part.at("shape").fail("a part has no parts; list them in the body");
      const SolidShape solid = read_shape(part, false);
      Pose place{.orientation = read_rotation(part)};
      if (const auto at = part.find("position_m")) place.position = at->vec3(kPlace);
      double mass = solid.volume;
      if (whole_has_mass) {
        part.forbid({"mass_kg", "density_kg_m3"}, "the body has it, or is fixed");
      } else {
        mass = part.one_of({"mass_kg", "density_kg_m3"}) == 0 ? part.at("mass_kg").number(kMass)
                                                              : part.at("density_kg_m3").number(kDensity) * mass;
      }
      volume += solid.volume;
      parts.push_back({{solid.shape, place * solid.frame, part.has("material") ? read_material(part) : material},
                       mass,
                       mass * solid.inertia_per_kg});
    });
  }
  faults.raise();
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
