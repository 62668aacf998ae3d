#pragma once

#include "camera.hpp"
#include "model/exchange.hpp"
#include "png_file.hpp"

#include <memory>
#include <optional>
#include <span>

namespace subworld {

/// One moment of a scene. Bodies without a finite state are not drawn.
struct Picture {
  std::span<const Body> bodies;
  std::span<const BodyState> states;  ///< of bodies[i]
  std::span<const Mesh> meshes;       ///< indexed by `Shape::mesh`
  std::span<const UserView> users;    ///< proxy, members, border bodies and border impulses of each user
  std::optional<Camera> camera;       ///< none: chosen so that all movable bodies fill the picture
  /// Length of the impulse lines; none: chosen by the largest impulse.
  std::optional<double> line_m_per_n_s;
};

struct PictureSize {
  int width = 1280;  ///< pixels
  int height = 720;  ///< pixels
};

/// A picture and the data for its caption.
struct Drawing {
  Image image;
  Camera camera;                ///< the camera in use; passed to the next picture it preserves the view
  double line_m_per_n_s = 0.0;  ///< length of the red lines per impulse; 0 if there are none
  double grid_m = 0.0;          ///< distance of the lines of the ground grid
  std::size_t omitted = 0;      ///< bodies without a finite state, orientation or shape
};

/// Draws the scene as in the paper's figure 13. The proxy is red, the members of a sub-world blue, other movable bodies
/// light grey. Border bodies are yellow, each with a red line from its centre along the sum of the border impulses on
/// it. A body in front of a member or of the proxy is translucent. Fixed boxes are glass, planes a ground grid.
///
/// Works without a display and without a graphics card. One thread at a time; any thread.
class Renderer {
 public:
  /// Throws `Error` (failed) with the cure if EGL or OpenGL 3.3 is missing, and `Error` (usage) if the size is not
  /// within 16 .. 8192 pixels.
  explicit Renderer(PictureSize size = {});
  ~Renderer();
  Renderer(const Renderer&) = delete;
  Renderer& operator=(const Renderer&) = delete;

  /// Throws `Error` (usage) if the given camera is invalid.
  [[nodiscard]] Drawing draw(const Picture& picture);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace subworld
