#include "model/error.hpp"
#include "model/scene/mesh_file.hpp"
#include "model/scene/scene_reader.hpp"
#include "model/shapes/mass_properties.hpp"
#include "model/shapes/shape_extent.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <filesystem>

namespace subworld {

namespace {

constexpr std::size_t kMostHullVertices = 10'000;  // the hull's time is quadratic in the vertices
const std::initializer_list<std::string_view> kShapes = {"sphere", "box",  "capsule",  "cylinder", "plane",
                                                         "convex", "mesh", "compound", "bin"};

/// The measures of each shape.
constexpr std::pair<std::string_view, std::string_view> kMeasures[] = {
    {"size_m", "box bin"},    {"radius_m", "sphere capsule cylinder tube"},
    {"top_radius_m", "tube"}, {"length_m", "capsule cylinder tube"},
    {"wall_m", "bin tube"},   {"sides", "tube"},
    {"file", "convex mesh"},  {"scale", "convex mesh"},
    {"up", "convex mesh"},    {"decompose", "mesh"},
    {"parts", "compound"},
};

/// Bounds and mass properties of everything but meshes.
SolidShape primitive(const Shape& shape) {
  SolidShape solid;
  solid.shape = shape;
  solid.volume = volume(shape);
  solid.inertia_per_kg = principal_inertia(shape, 1.0);
  if (shape.kind == ShapeKind::plane) return solid;
  solid.half_extents = bounds(shape, {}, {}).upper;
  solid.bounding_radius = bounding_radius(shape, {});
  return solid;
}

}  // namespace

SolidShape convex_solid(const YamlValue& place, Mesh& mesh) {
  if (mesh.vertices.size() > kMostHullVertices) {
    place.fail(fmt::format("a convex shape has at most {} vertices, this file has {}; simplify it", kMostHullVertices,
                           mesh.vertices.size()));
  }
  mesh = convex_hull(mesh);
  if (mesh.triangles.empty()) place.fail("the surface is flat, it encloses nothing; use a box or shape: mesh");
  if (!closed(mesh)) place.fail("no closed convex hull was found around its points; simplify the mesh");
  const PrincipalFrame principal = move_to_principal_frame(mesh);
  SolidShape solid;
  solid.frame = principal.frame;
  solid.volume = principal.volume;
  solid.inertia_per_kg = principal.inertia / principal.volume;
  for (const Vec3& v : mesh.vertices) {
    solid.half_extents = solid.half_extents.cwiseMax(v.cwiseAbs());
    solid.bounding_radius = std::max(solid.bounding_radius, v.norm());
  }
  return solid;
}

void forbid_other_measures(const YamlMap& map, std::string_view shape) {
  for (const auto& [key, shapes] : kMeasures) {
    if (shapes.find(shape) == std::string_view::npos) map.forbid({key}, fmt::format("a {} has no such measure", shape));
  }
}

SolidShape BodyReader::read_shape(const YamlMap& map, bool fixed) {
  const YamlValue at = map.at("shape");
  Shape shape;
  const std::string word = at.text();
  if (word == "tube") at.fail("a tube is a part; write shape: compound, parts: [{shape: tube, ...}]");
  const std::size_t kind = at.choice(kShapes);  // in the order of ShapeKind
  if (word == "bin") at.fail("a bin cannot be a proxy or a part; use a box, sphere, capsule, cylinder or convex");
  shape.kind = static_cast<ShapeKind>(kind);
  const bool movable_mesh = word == "mesh" && !fixed;
  if (word != "compound" && !movable_mesh) {
    map.forbid({"inertia_kg_m2", "centre_of_mass_m"},
               "they follow from the shape; write shape: compound with one part");
  }
  forbid_other_measures(map, word);
  if (fixed) map.forbid({"decompose"}, "a fixed mesh has its triangles as they are");
  if (!fixed && shape.kind == ShapeKind::plane)
    at.fail("a plane cannot move; add \"fixed: true\" or use another shape");
  switch (shape.kind) {
    case ShapeKind::convex:
    case ShapeKind::mesh:
      return movable_mesh ? read_movable_mesh(map) : read_mesh_shape(map, shape.kind);
    case ShapeKind::compound:
      return read_compound(map, fixed);
    case ShapeKind::plane:
      break;
    case ShapeKind::box:
      shape.half_extents = 0.5 * map.at("size_m").vec3(kLength);
      break;
    case ShapeKind::sphere:
      shape.radius = map.at("radius_m").number(kLength);
      break;
    case ShapeKind::capsule:
    case ShapeKind::cylinder:
      shape.radius = map.at("radius_m").number(kLength);
      shape.half_length = 0.5 * map.at("length_m").number(kLength);
      break;
  }
  return primitive(shape);
}

BodyReader::MeshWords BodyReader::read_mesh_words(const YamlMap& map) {
  MeshWords words{.file = map.at("file").text()};
  map.read("scale", words.scale, {.least = 1e-9, .most = 1e9});
  if (const auto up = map.find("up")) {
    if (tells_up_axis(words.file)) up->fail(fmt::format("\"{}\" tells its up axis itself; remove the key", words.file));
    words.y_up = up->choice({"z", "y"}) == 1;
  }
  return words;
}

Mesh BodyReader::read_mesh_file(const YamlMap& map, const MeshWords& words) const {
  try {
    return read_mesh((std::filesystem::path(scene_.file).parent_path() / words.file).string(), words.scale, words.y_up);
  } catch (const std::runtime_error& e) {
    map.at("file").fail(fmt::format("\"{}\" {}", words.file, e.what()));
  }
}

SolidShape BodyReader::read_mesh_shape(const YamlMap& map, ShapeKind kind) {
  const MeshWords words = read_mesh_words(map);
  const std::pair key(words, kind);
  if (const auto known = meshes_.find(key); known != meshes_.end()) return known->second;
  Mesh mesh = read_mesh_file(map, words);
  SolidShape solid;
  if (kind == ShapeKind::convex) solid = convex_solid(map.at("file"), mesh);
  mesh.file = words.file;
  solid.shape.kind = kind;
  solid.shape.mesh = static_cast<std::uint32_t>(scene_.meshes.size());
  scene_.meshes.push_back(std::move(mesh));
  meshes_[key] = solid;
  return solid;
}

}  // namespace subworld
