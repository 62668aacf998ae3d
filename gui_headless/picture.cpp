#include "picture.hpp"

#include "figure.hpp"
#include "gl_context.hpp"
#include "model/error.hpp"
#include "painter.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

namespace subworld {
namespace {

PictureSize checked(PictureSize size) {
  if (std::min(size.width, size.height) < 16 || std::max(size.width, size.height) > 8192) {
    throw Error(ExitCode::usage, fmt::format("picture of {} x {} pixels: width and height must lie within 16 .. 8192",
                                             size.width, size.height));
  }
  return size;
}

}  // namespace

struct Renderer::Parts {
  explicit Parts(PictureSize wanted) : size(checked(wanted)) {
    const GlContext::Current current(context);
    painter.emplace(size);
  }

  PictureSize size;
  GlContext context;
  std::optional<Painter> painter;  // created while the context is current
};

Renderer::Renderer(PictureSize size) : parts_(std::make_unique<Parts>(size)) {}
Renderer::~Renderer() = default;

Drawing Renderer::draw(const Picture& picture) {
  const Figure figure = compose(picture, parts_->size);
  const GlContext::Current current(parts_->context);
  return {parts_->painter->paint(figure, picture.meshes, picture.bodies.size()), figure.camera, figure.line_m_per_n_s,
          figure.grid_m, figure.omitted};
}

}  // namespace subworld
