#include "model/scene/movable_mesh.hpp"
#include "model/scene/parts_cache.hpp"
#include "model/scene/scene_reader.hpp"
#include "model/shapes/mass_properties.hpp"

#include <fmt/core.h>

namespace subworld {

namespace {

constexpr std::size_t kMostTrianglesThatMove = 50'000;  ///< a minute of computing
constexpr double kConcavity = 0.01;                     ///< of the mesh's diagonal, by default
constexpr int kUsualParts = 64;
constexpr double kLeastVolume = 1e-6;  ///< of the diagonal's cube: less is a sheet

constexpr std::string_view kOtherShapes = "or use shape: convex, or \"fixed: true\"";

double diagonal(const Mesh& mesh) {
  Box box{mesh.vertices[0], mesh.vertices[0]};
  for (const Vec3& v : mesh.vertices) box.extend({v, v});
  return (box.upper - box.lower).norm();
}

}  // namespace

std::optional<std::pair<std::string, std::string>> turn_outwards(Mesh& mesh) {
  if (mesh.triangles.size() > kMostTrianglesThatMove)
    return std::pair(fmt::format("has more than {} triangles", kMostTrianglesThatMove), "simplify it");
  if (!closed(mesh)) {
    return std::pair("is not closed: an edge has not two triangles that face the same way",
                     "fill holes, and remove double and inner faces");
  }
  const double volume = integrate(mesh).volume;
  if (!(std::abs(volume) > kLeastVolume * std::pow(diagonal(mesh), 3)))
    return std::pair("encloses no volume", "give it a thickness");
  if (volume < 0.0) {
    for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
  }
  return std::nullopt;
}

double usual_concavity_m(const Mesh& mesh) { return kConcavity * diagonal(mesh); }

SolidShape BodyReader::read_movable_mesh(const YamlMap& map) {
  Faults faults;
  MeshWords words;
  faults.collect([&] { words = read_mesh_words(map); });
  double concavity_m = 0.0;  // of the mesh
  int most_parts = kUsualParts;
  faults.collect([&] {
    const auto value = map.find("decompose");
    if (!value) return;
    const YamlMap settings(*value, {"concavity_m", "most_parts"}, faults);
    faults.collect([&] { settings.read("concavity_m", concavity_m, kLength); });
    faults.collect([&] { settings.read("most_parts", most_parts, 1, kMostParts); });
  });
  faults.raise();
  const std::tuple key(words, concavity_m, most_parts);
  auto known = divided_.find(key);
  if (known == divided_.end()) known = divided_.emplace(key, divide(map, words, concavity_m, most_parts)).first;
  MassProperties whole = known->second.whole;
  const double volume = whole.mass;
  read_inertia(map, whole);
  std::vector<WeightedPart> parts;
  const Material material = read_material(map, materials_);
  for (const auto& [shape, pose] : known->second.parts)
    parts.push_back({.part = {.shape = shape, .pose = pose, .material = material}});
  SolidShape solid = add_compound(assemble(parts, scene_.meshes, whole), volume);
  solid.mass = 0.0;
  return solid;
}

BodyReader::SolidParts BodyReader::divide(const YamlMap& map, const MeshWords& words, double concavity_m,
                                          int most_parts) {
  const YamlValue at = map.at("file");
  Mesh mesh = read_mesh_file(map, words);
  if (const auto fault = turn_outwards(mesh)) {
    at.fail(fmt::format("\"{}\" {}, so it cannot move as a mesh; {}, {}", words.file, fault->first, fault->second,
                        kOtherShapes));
  }
  const Solid solid = integrate(mesh);
  if (concavity_m == 0.0) concavity_m = usual_concavity_m(mesh);
  DividedMesh& report = scene_.divided.emplace_back(DividedMesh{.file = words.file, .concavity_m = concavity_m});
  ConvexParts convex = cached_parts(mesh, concavity_m, static_cast<std::size_t>(most_parts), scene_.file, report.cache);
  report.parts = convex.hulls.size();
  report.error_m = convex.error_m;
  SolidParts result{.whole = {solid.volume, solid.centre, solid.inertia}};
  for (Mesh& hull : convex.hulls) {
    SolidShape part = convex_solid(at, hull);
    hull.file = words.file;
    part.shape = {.kind = ShapeKind::convex, .mesh = static_cast<std::uint32_t>(scene_.meshes.size())};
    scene_.meshes.push_back(std::move(hull));
    result.parts.emplace_back(part.shape, part.frame);
  }
  return result;
}

}  // namespace subworld
