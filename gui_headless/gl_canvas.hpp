#pragma once

#include "picture.hpp"
#include "shape_mesh.hpp"

#include <epoxy/gl.h>

#include <map>
#include <string>
#include <vector>

/// The few pieces of OpenGL that the renderer is made of. All need a current context. What they create is freed with
/// the context, unless it is replaced while the program runs.
namespace subworld {

/// A vertex and a fragment shader, linked. Throws `Error` (failed) with the driver's message.
class GlProgram {
 public:
  GlProgram(const char* vertex, const std::string& fragment);
  void use() const;
  void set(const char* name, float value) const;
  void set(const char* name, int value) const;
  void set(const char* name, const Eigen::Vector2f& value) const;
  void set(const char* name, const Eigen::Vector3f& value) const;
  void set(const char* name, const Eigen::Matrix4f& value) const;

 private:
  [[nodiscard]] GLint place(const char* name) const;
  GLuint id_;
};

/// Triangles on the card.
struct GlMesh {
  GLuint array = 0;
  GLuint vertices = 0;
  GLuint indices = 0;
  GLsizei count = 0;  ///< of indices
};
[[nodiscard]] GlMesh upload(const ShapeMesh& mesh);
void release(const GlMesh& mesh);

/// Where pictures are drawn: colour, depth and stencil with several samples a pixel, and how they come back.
class GlTarget {
 public:
  explicit GlTarget(PictureSize size);
  /// Following drawing goes here.
  void bind() const;
  /// Averages the samples.
  [[nodiscard]] Image read() const;

 private:
  PictureSize size_;
  GLuint drawn_ = 0;
  GLuint averaged_ = 0;
};

/// Depths as the key light sees them.
class GlShadowMap {
 public:
  GlShadowMap();
  void bind() const;
  /// For the shaders' `shadow_map`, unit 0.
  void bind_texture() const;
  [[nodiscard]] static int width();  ///< pixels

 private:
  GLuint frame_ = 0;
  GLuint texture_ = 0;
};

}  // namespace subworld
