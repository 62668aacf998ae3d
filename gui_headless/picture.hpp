#pragma once

#include "camera.hpp"
#include "model/exchange.hpp"
#include "png_file.hpp"

#include <memory>
#include <optional>
#include <span>

namespace subworld {

/// One moment of a scene. Bodies without a finite state are left out.
struct Picture {
  std::span<const Body> bodies;
  std::span<const BodyState> states;  ///< of bodies[i]
  std::span<const Mesh> meshes;       ///< that `Shape::mesh` counts
  std::span<const UserView> users;    ///< who is proxy, member and border body, and the border impulses
  std::optional<Camera> camera;       ///< none: all movable bodies fill the picture
  /// Length of the lines that show impulses; none: the largest gets the length that reads best.
  std::optional<double> line_m_per_n_s;
};

struct PictureSize {
  int width = 1280;  ///< pixels
  int height = 720;  ///< pixels
};

/// A picture and what its caption needs.
struct Drawing {
  Image image;
  Camera camera;                ///< that was used; given back in the next picture it keeps the view still
  double line_m_per_n_s = 0.0;  ///< length of the red lines per impulse; 0 if there are none
  double grid_m = 0.0;          ///< between two lines of the ground grid
  std::size_t omitted = 0;      ///< bodies without a finite state, orientation or shape
};

/// Draws the scene as the paper's figure 13 does: the proxy red, the members of a sub-world blue, border bodies yellow
/// with a red line from their centre along the sum of the border impulses on them, other movable bodies light grey.
/// What lies in front of a member or of the proxy is drawn as a veil. Fixed boxes are glass, planes a ground grid.
///
/// Works without a display and without a graphics card. One thread at a time; any thread.
class Renderer {
 public:
  /// Throws `Error` (failed) with the cure if there is no EGL or no OpenGL 3.3, `Error` (usage) if the size is not
  /// within 16 .. 8192 pixels.
  explicit Renderer(PictureSize size = {});
  ~Renderer();
  Renderer(const Renderer&) = delete;
  Renderer& operator=(const Renderer&) = delete;

  /// Throws `Error` (usage) if the given camera looks nowhere.
  [[nodiscard]] Drawing draw(const Picture& picture);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace subworld
