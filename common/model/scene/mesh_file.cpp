#include "model/scene/mesh_file.hpp"

#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <assimp/Importer.hpp>

#include <fmt/core.h>

#include <array>
#include <filesystem>
#include <map>
#include <stdexcept>
#include <system_error>

namespace subworld {

namespace {

constexpr std::uintmax_t kLargestMeshFile = 64U << 20U;  // bytes
constexpr std::size_t kMostTriangles = 1'000'000;

/// Appends triangles. Vertices with exactly equal coordinates become one.
class Welder {
 public:
  explicit Welder(Mesh& mesh) : mesh_(mesh) {}

  void add(const aiMesh& part, double scale) {
    for (unsigned f = 0; f < part.mNumFaces; ++f) {
      const aiFace& face = part.mFaces[f];
      if (face.mNumIndices != 3) continue;  // points and lines
      std::array<std::uint32_t, 3> triangle{};
      for (unsigned k = 0; k < 3; ++k) triangle[k] = vertex(part.mVertices[face.mIndices[k]], scale);
      if (triangle[0] == triangle[1] || triangle[1] == triangle[2] || triangle[2] == triangle[0]) continue;
      if (mesh_.triangles.size() == kMostTriangles) {
        throw std::runtime_error(fmt::format("has more than {} triangles; simplify it", kMostTriangles));
      }
      mesh_.triangles.push_back(triangle);
    }
  }

 private:
  std::uint32_t vertex(const aiVector3D& at, double scale) {
    const Vec3 v = scale * Vec3(at.x, at.y, at.z);
    if (!v.allFinite()) throw std::runtime_error("has a vertex that is not finite; export it again");
    const auto [found, added] =
        known_.try_emplace({at.x, at.y, at.z}, static_cast<std::uint32_t>(mesh_.vertices.size()));
    if (added) mesh_.vertices.push_back(v);
    return found->second;
  }

  Mesh& mesh_;
  std::map<std::array<ai_real, 3>, std::uint32_t> known_;
};

}  // namespace

Mesh read_mesh(const std::string& file, double scale) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) {
    throw std::runtime_error(fmt::format("no such mesh file: {}; paths are relative to the scene file's folder", file));
  }
  if (std::filesystem::file_size(file, error) > kLargestMeshFile) {
    throw std::runtime_error(fmt::format("is larger than {} MB; simplify it", kLargestMeshFile >> 20U));
  }
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile(file, aiProcess_Triangulate | aiProcess_PreTransformVertices);
  if (scene == nullptr) {
    throw std::runtime_error(
        fmt::format("cannot be read as a mesh: {}; export it as STL or OBJ", importer.GetErrorString()));
  }
  Mesh mesh;
  mesh.file = file;
  Welder welder(mesh);
  for (unsigned i = 0; i < scene->mNumMeshes; ++i) welder.add(*scene->mMeshes[i], scale);
  if (mesh.triangles.empty()) throw std::runtime_error("has no triangles; export the surface");
  return mesh;
}

}  // namespace subworld
