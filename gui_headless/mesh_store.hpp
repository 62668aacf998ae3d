#pragma once

#include "figure.hpp"
#include "gl_canvas.hpp"

#include <array>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

namespace subworld {

/// Instances of one mesh: which part of the instance buffer they are.
struct Group {
  GlMesh mesh;
  std::size_t first = 0;
  std::size_t count = 0;
  bool closed = false;  ///< its back faces are never seen
};
using Groups = std::vector<Group>;

/// The triangles on the card: the unit shapes, finer while there are few bodies, and those of files. Needs a current
/// context, as the canvas does.
class MeshStore {
 public:
  MeshStore();

  /// A new picture: forgets the instances, and the files that the last picture did not use.
  void begin(std::span<const Mesh> meshes, std::size_t bodies);
  /// Adds a batch's instances to the instance buffer.
  [[nodiscard]] Groups add(const Batch& batch);
  /// Sends the instance buffer; groups can be drawn from here on.
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

/// Draws the instances with the program in use; of closed meshes, unless asked, the front faces only.
void draw(const Groups& groups, Faces faces = Faces::front);

}  // namespace subworld
