#pragma once

#include "figure.hpp"
#include "gl_canvas.hpp"

#include <array>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

namespace subworld {

/// Instances of one mesh: a range of the instance buffer.
struct Group {
  GlMesh mesh;
  std::size_t first = 0;
  std::size_t count = 0;
  bool closed = false;  ///< its back faces are never visible
};
using Groups = std::vector<Group>;

/// The triangles in graphics memory: the unit shapes, finer while there are few bodies, and those of files. Needs a
/// current context, as the canvas does.
class MeshStore {
 public:
  MeshStore();

  /// Starts a new picture: removes the instances, and the files that the last picture did not use.
  void begin(std::span<const Mesh> meshes, std::size_t bodies);
  /// Adds a batch's instances to the instance buffer.
  [[nodiscard]] Groups add(const Batch& batch);
  /// Uploads the instance buffer. Groups can be drawn after it.
  void end();

 private:
  struct File {
    GlMesh mesh;
    bool used = false;
  };
  [[nodiscard]] GlMesh find(Model model);

  std::array<std::array<GlMesh, 5>, 3> units_{};  ///< from fine to coarse
  std::unordered_map<std::uint64_t, File> files_;
  std::span<const Mesh> meshes_;
  std::size_t fineness_ = 0;
  std::vector<Instance> instances_;
  GLuint buffer_ = 0;
};

enum class Faces : std::uint8_t { front, both };

/// Draws the instances with the program in use. Of closed meshes, draws only the front faces unless requested
/// otherwise.
void draw(const Groups& groups, Faces faces = Faces::front);

}  // namespace subworld
