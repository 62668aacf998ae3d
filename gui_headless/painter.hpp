#pragma once

#include "figure.hpp"
#include "gl_canvas.hpp"
#include "mesh_store.hpp"
#include "view.hpp"

namespace subworld {

/// The passes of a picture, from the sky to the impulse lines. Needs a current context.
class Painter {
 public:
  explicit Painter(PictureSize size);

  [[nodiscard]] Image paint(const Figure& figure, std::span<const Mesh> meshes, std::size_t bodies);

 private:
  struct Look {
    float shadow = 0.0F;    ///< darkness of shadows, 0 .. 1
    float flatness = 0.0F;  ///< 0: shaded, 1: the plain colour
    float edge_pixels = 1.2F;
    bool glass = false;
  };

  void begin_bodies(const View& view, const Look& look) const;
  void cast_shadows(const View& view, std::initializer_list<const Groups*> casters) const;
  void paint_sky() const;
  /// `veil`: opacity of this layer where an earlier layer is marked.
  void paint_layer(const View& view, const Groups& groups, const Look& look, float veil) const;
  void mark(const View& view, const Groups& groups) const;
  void paint_grounds(const View& view, const Figure& figure) const;
  void paint_glass(const View& view, const Groups& groups) const;
  void paint_lines(const View& view, const Groups& halos, const Groups& lines) const;

  PictureSize size_;
  GlTarget target_;
  GlShadowMap shadow_map_;
  GlProgram bodies_;
  GlProgram depths_;
  GlProgram ground_;
  GlProgram sky_;
  MeshStore store_;
  GLuint no_vertices_ = 0;  ///< for programs that compute their own vertices
};

}  // namespace subworld
