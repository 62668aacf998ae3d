#include "painter.hpp"

#include "shaders.hpp"

#include <cmath>

namespace subworld {
namespace {

constexpr float kMemberVeil = 0.20F;  // share of a member's colour where the proxy is behind it
constexpr float kOtherVeil = 0.22F;   // share of another body's colour where a member or the proxy is behind it

}  // namespace

Painter::Painter(PictureSize size)
    : size_(size),
      target_(size),
      bodies_(shaders::kBodyVertex, std::string(shaders::kShadow) + shaders::kBodyFragment),
      depths_(shaders::kBodyVertex, shaders::kDepthFragment),
      ground_(shaders::kGroundVertex, std::string(shaders::kShadow) + shaders::kGroundFragment),
      sky_(shaders::kSkyVertex, shaders::kSkyFragment) {
  glGenVertexArrays(1, &no_vertices_);
}

Image Painter::paint(const Figure& figure, std::span<const Mesh> meshes, std::size_t bodies) {
  const View view = view_of(figure, size_);
  store_.begin(meshes, bodies);
  const Groups proxies = store_.add(figure.proxies);
  const Groups members = store_.add(figure.members);
  const Groups others = store_.add(figure.others);
  const Groups glass = store_.add(figure.glass);
  const Groups halos = store_.add(figure.halos);
  const Groups lines = store_.add(figure.lines);
  store_.end();
  cast_shadows(view, {&proxies, &members, &others});
  target_.bind();
  paint_sky();
  // From the most to the least important layer: each is blended over the layers before it.
  paint_layer(view, proxies, {}, 1.0F);
  mark(view, proxies);
  paint_layer(view, members, {}, proxies.empty() ? 1.0F : kMemberVeil);
  mark(view, members);
  const bool nothing_inside = proxies.empty() && members.empty();
  paint_layer(view, others, {.shadow = 0.75F}, nothing_inside ? 1.0F : kOtherVeil);
  paint_grounds(view, figure);
  paint_glass(view, glass);
  paint_lines(view, halos, lines);
  return target_.read();
}

void Painter::cast_shadows(const View& view, std::initializer_list<const Groups*> casters) const {
  shadow_map_.bind();
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_LESS);
  glDepthMask(GL_TRUE);
  glDisable(GL_STENCIL_TEST);
  glClear(GL_DEPTH_BUFFER_BIT);
  // Without an offset, surfaces shade themselves in stripes.
  glEnable(GL_POLYGON_OFFSET_FILL);
  glPolygonOffset(2.5F, 8.0F);
  depths_.use();
  depths_.set("view_projection", view.light);
  for (const auto* groups : casters) draw(*groups);
  glDisable(GL_POLYGON_OFFSET_FILL);
  shadow_map_.bind_texture();
}

void Painter::paint_sky() const {
  glDepthMask(GL_TRUE);
  glClearStencil(0);
  glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT | GL_STENCIL_BUFFER_BIT);
  glDisable(GL_DEPTH_TEST);
  sky_.use();
  glBindVertexArray(no_vertices_);
  glDrawArrays(GL_TRIANGLES, 0, 3);
  glEnable(GL_DEPTH_TEST);
}

void Painter::begin_bodies(const View& view, const Look& look) const {
  bodies_.use();
  bodies_.set("view_projection", view.camera);
  bodies_.set("light_projection", view.light);
  bodies_.set("shadow_map", 0);
  bodies_.set("shadow_texel", static_cast<float>(view.light_width / GlShadowMap::width()));
  bodies_.set("eye", view.eye);
  bodies_.set("key_light", view.key_light);
  bodies_.set("fill_light", view.fill_light);
  bodies_.set("shadow_strength", look.shadow);
  bodies_.set("flatness", look.flatness);
  bodies_.set("edge_pixels", look.edge_pixels * std::max(1.0F, static_cast<float>(size_.height) / 720.0F));
  bodies_.set("glass", look.glass ? 1 : 0);
}

// Where an earlier layer is marked, only the nearest surface of this layer is blended over it. This needs no sorting:
// the depth pass finds that surface, and the colour passes draw only it.
void Painter::paint_layer(const View& view, const Groups& groups, const Look& look, float veil) const {
  if (veil == 1.0F) {
    begin_bodies(view, look);
    draw(groups);
    return;
  }
  glColorMask(GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
  depths_.use();
  depths_.set("view_projection", view.camera);
  draw(groups);
  glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
  begin_bodies(view, look);
  glDepthFunc(GL_EQUAL);
  glDepthMask(GL_FALSE);
  glEnable(GL_STENCIL_TEST);
  glStencilOp(GL_KEEP, GL_KEEP, GL_KEEP);
  glStencilFunc(GL_EQUAL, 0, 0xFF);
  draw(groups);
  glStencilFunc(GL_NOTEQUAL, 0, 0xFF);
  glEnable(GL_BLEND);
  glBlendColor(0.0F, 0.0F, 0.0F, veil);
  glBlendFunc(GL_CONSTANT_ALPHA, GL_ONE_MINUS_CONSTANT_ALPHA);
  draw(groups);
  glDisable(GL_BLEND);
  glDisable(GL_STENCIL_TEST);
  glDepthFunc(GL_LESS);
  glDepthMask(GL_TRUE);
}

// A pass of its own: two faces of equal depth in one layer, as of touching cubes, must not be blended over each other.
void Painter::mark(const View& view, const Groups& groups) const {
  glColorMask(GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
  glDepthFunc(GL_LEQUAL);
  glEnable(GL_STENCIL_TEST);
  glStencilFunc(GL_ALWAYS, 1, 0xFF);
  glStencilOp(GL_KEEP, GL_KEEP, GL_REPLACE);
  depths_.use();
  depths_.set("view_projection", view.camera);
  draw(groups);
  glDisable(GL_STENCIL_TEST);
  glDepthFunc(GL_LESS);
  glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
}

void Painter::paint_grounds(const View& view, const Figure& figure) const {
  ground_.use();
  ground_.set("view_projection", view.camera);
  ground_.set("light_projection", view.light);
  ground_.set("shadow_map", 0);
  ground_.set("shadow_texel", static_cast<float>(view.light_width / GlShadowMap::width()));
  ground_.set("spacing", static_cast<float>(figure.grid_m));
  ground_.set("reach", static_cast<float>(view.ground_reach));
  glEnable(GL_BLEND);
  glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
  glDepthMask(GL_FALSE);
  glEnable(GL_CULL_FACE);  // from below, the ground would cover everything
  glBindVertexArray(no_vertices_);
  for (const auto& ground : figure.grounds) {
    const double period = 10.0 * figure.grid_m;
    const Eigen::Vector2d offset = ground.offset - period * (ground.offset / period).array().floor().matrix();
    ground_.set("origin", Eigen::Vector3f(ground.origin.cast<float>()));
    ground_.set("axis_x", Eigen::Vector3f((ground.orientation * Vec3::UnitX()).cast<float>()));
    ground_.set("axis_y", Eigen::Vector3f((ground.orientation * Vec3::UnitY()).cast<float>()));
    ground_.set("offset", Eigen::Vector2f(offset.cast<float>()));
    glDrawArrays(GL_TRIANGLE_STRIP, 0, 4);
  }
  glDisable(GL_CULL_FACE);
  glDepthMask(GL_TRUE);
  glDisable(GL_BLEND);
}

void Painter::paint_glass(const View& view, const Groups& groups) const {
  begin_bodies(view, {.edge_pixels = 0.9F, .glass = true});
  glEnable(GL_BLEND);
  glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
  glDepthMask(GL_FALSE);
  draw(groups, Faces::both);
  glDepthMask(GL_TRUE);
  glDisable(GL_BLEND);
}

// Drawn on top of everything. Among lines, the nearer hides the farther one.
void Painter::paint_lines(const View& view, const Groups& halos, const Groups& lines) const {
  glClear(GL_DEPTH_BUFFER_BIT);
  begin_bodies(view, {.flatness = 1.0F, .edge_pixels = -1.0F});
  draw(halos);
  glClear(GL_DEPTH_BUFFER_BIT);
  begin_bodies(view, {.flatness = 0.55F, .edge_pixels = -1.0F});
  draw(lines);
}

}  // namespace subworld
