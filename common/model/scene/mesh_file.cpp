#include "model/scene/mesh_file.hpp"

#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <assimp/Importer.hpp>

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <stdexcept>
#include <string_view>
#include <system_error>

namespace subworld {

namespace {

constexpr std::uintmax_t kLargestMeshFile = 64U << 20U;  // bytes
constexpr std::size_t kMostTriangles = 1'000'000;
constexpr double kDigit = 6e-8;      ///< relative rounding of the importer's coordinates
constexpr double kMostError = 1e-4;  ///< of a mesh's extent

/// Appends triangles. Vertices with exactly equal coordinates become one.
class Welder {
 public:
  Welder(Mesh& mesh, double scale, bool y_up) : mesh_(mesh), scale_(scale), y_up_(y_up) {}

  void add(const aiMesh& part) {
    for (unsigned f = 0; f < part.mNumFaces; ++f) {
      const aiFace& face = part.mFaces[f];
      if (face.mNumIndices != 3) continue;  // points and lines
      std::array<std::uint32_t, 3> triangle{};
      for (unsigned k = 0; k < 3; ++k) triangle[k] = vertex(part.mVertices[face.mIndices[k]]);
      if (triangle[0] == triangle[1] || triangle[1] == triangle[2] || triangle[2] == triangle[0]) continue;
      if (mesh_.triangles.size() == kMostTriangles) {
        throw std::runtime_error(fmt::format("has more than {} triangles; simplify it", kMostTriangles));
      }
      mesh_.triangles.push_back(triangle);
    }
  }

 private:
  std::uint32_t vertex(const aiVector3D& at) {
    const Vec3 v = scale_ * (y_up_ ? Vec3(at.x, -at.z, at.y) : Vec3(at.x, at.y, at.z));
    if (!v.allFinite()) throw std::runtime_error("has a vertex that is not finite; export it again");
    const auto [found, added] =
        known_.try_emplace({at.x, at.y, at.z}, static_cast<std::uint32_t>(mesh_.vertices.size()));
    if (added) mesh_.vertices.push_back(v);
    return found->second;
  }

  Mesh& mesh_;
  double scale_;
  bool y_up_;
  std::map<std::array<ai_real, 3>, std::uint32_t> known_;
};

/// Refuses coordinates so far from the origin that the importer has rounded the shape.
void check_digits(const Mesh& mesh) {
  Box box{mesh.vertices[0], mesh.vertices[0]};
  for (const Vec3& v : mesh.vertices) box.extend({v, v});
  const double far_m = box.lower.cwiseAbs().cwiseMax(box.upper.cwiseAbs()).maxCoeff();
  const double error_m = kDigit * far_m, extent_m = (box.upper - box.lower).maxCoeff();
  if (error_m <= kMostError * extent_m) return;
  throw std::runtime_error(
      fmt::format("has coordinates of up to {:.3g} m, which the importer rounds to {:.1g} m, for a shape of {:.3g} m; "
                  "move the shape to the file's origin, and the body by position_m",
                  far_m, error_m, extent_m));
}

/// Of the formats that are text, the importer takes a byte-order mark for a part of the first word.
const aiScene* import(Assimp::Importer& importer, const std::string& file) {
  constexpr unsigned kSteps = aiProcess_Triangulate | aiProcess_PreTransformVertices;
  constexpr std::string_view kMark = "\xEF\xBB\xBF";
  std::ifstream stream(file, std::ios::binary);
  std::string begin(kMark.size(), '\0');
  stream.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  if (begin != kMark || tells_up_axis(file)) return importer.ReadFile(file, kSteps);
  const std::string rest{std::istreambuf_iterator<char>(stream), {}};
  return importer.ReadFileFromMemory(rest.data(), rest.size(), kSteps, file.substr(file.rfind('.') + 1).c_str());
}

}  // namespace

bool tells_up_axis(const std::string& file) {
  std::string ending = std::filesystem::path(file).extension().string();
  std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return std::tolower(c); });
  return ending == ".dae" || ending == ".gltf" || ending == ".glb";
}

Mesh read_mesh(const std::string& file, double scale, bool y_up) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) {
    throw std::runtime_error(fmt::format("no such mesh file: {}; paths are relative to the scene file's folder", file));
  }
  if (std::filesystem::is_empty(file, error)) throw std::runtime_error("is empty; export the mesh again");
  if (std::filesystem::file_size(file, error) > kLargestMeshFile) {
    throw std::runtime_error(fmt::format("is larger than {} MB; simplify it", kLargestMeshFile >> 20U));
  }
  Assimp::Importer importer;
  const aiScene* scene = import(importer, file);
  if (scene == nullptr) {
    std::string why = importer.GetErrorString();
    why.erase(why.find_last_not_of(" .;\n") + 1);
    throw std::runtime_error(
        fmt::format("cannot be read as a mesh: {}; is the file complete? Export it again, as STL or OBJ", why));
  }
  Mesh mesh;
  mesh.file = file;
  Welder welder(mesh, scale, y_up || tells_up_axis(file));  // the importer turns Collada's up axis to y, as in glTF
  for (unsigned i = 0; i < scene->mNumMeshes; ++i) welder.add(*scene->mMeshes[i]);
  if (mesh.triangles.empty()) throw std::runtime_error("has no triangles; export the surface");
  check_digits(mesh);
  return mesh;
}

}  // namespace subworld
