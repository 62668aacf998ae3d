#pragma once

#include "picture.hpp"
#include "shape_mesh.hpp"

#include <epoxy/gl.h>

#include <cstddef>
#include <string>
#include <vector>

/// OpenGL objects of the renderer. All need a current context. They are freed with the context, unless they are
/// replaced while the program runs.
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

/// Triangles in graphics memory.
struct GlMesh {
  GLuint array = 0;
  GLuint vertices = 0;
  GLuint indices = 0;
  GLsizei count = 0;  ///< of indices
};
/// Describes `size` floats at `offset` (bytes) of each vertex, or with a `divisor` of each instance, in the bound
/// buffer.
void describe_attribute(GLuint location, GLint size, std::size_t stride, std::size_t offset, GLuint divisor = 0);
[[nodiscard]] GlMesh upload(const ShapeMesh& mesh);
void release(const GlMesh& mesh);

/// Render target with colour, depth and stencil, and several samples a pixel.
class GlTarget {
 public:
  explicit GlTarget(PictureSize size);
  /// Makes this the target of further drawing.
  void bind() const;
  /// Averages the samples and returns the image.
  [[nodiscard]] Image read() const;

 private:
  PictureSize size_;
  GLuint drawn_ = 0;
  GLuint averaged_ = 0;
};

/// Depth map as seen from the key light.
class GlShadowMap {
 public:
  GlShadowMap();
  void bind() const;
  /// Binds to the shaders' `shadow_map`, unit 0.
  void bind_texture() const;
  [[nodiscard]] static int width();  ///< pixels

 private:
  GLuint frame_ = 0;
  GLuint texture_ = 0;
};

}  // namespace subworld
