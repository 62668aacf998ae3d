#pragma once

#include "camera.hpp"
#include "model/joint.hpp"
#include "model/messages/exchange.hpp"

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace subworld {

/// Rows from the top, pixels from the left, three bytes each (sRGB).
struct Image {
  int width = 0;   ///< pixels
  int height = 0;  ///< pixels
  std::vector<std::uint8_t> rgb;

  /// First of the three bytes of a pixel; the pixel must be inside the image.
  [[nodiscard]] const std::uint8_t* pixel(int column, int row) const noexcept {
    return rgb.data() + 3 * (static_cast<std::size_t>(row) * static_cast<std::size_t>(width) + column);
  }
};

/// `software` is in the file as the text of that keyword. Throws `Error` (failed) with the file's name and the reason,
/// also if the image's size and its bytes disagree.
void write_png(const std::string& file, const Image& image, const std::string& software);

/// One moment of a scene. Bodies without a finite state are not drawn.
struct Picture {
  std::span<const Body> bodies;
  std::span<const BodyState> states;  ///< of bodies[i]
  std::span<const Mesh> meshes;       ///< indexed by `Shape::mesh`
  std::span<const UserView> users;    ///< proxy, members, border bodies and border impulses of each user
  std::optional<Camera> camera;       ///< none: chosen so that all movable bodies fill the picture
  /// Length of the impulse lines; none: chosen by the largest impulse.
  std::optional<double> line_m_per_n_s;
  std::span<const Joint> joints = {};  ///< of bodies[i] with the id i
  std::span<const std::uint32_t> broken_joints = {};
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
  std::size_t omitted = 0;      ///< bodies without a finite state, orientation or shape
};

/// The camera of a picture that gives none.
[[nodiscard]] Camera automatic_camera(const Picture& picture, PictureSize size);

/// Draws the scene as in the paper's figure 13. The proxy is red, the members of a sub-world blue, other movable bodies
/// light grey. Border bodies are yellow, each with a red line from its centre along the sum of the border impulses on
/// it. Joints are magenta marks in front of all bodies. A body in front of a member or of the proxy is translucent.
/// Fixed boxes are glass, planes a ground grid.
///
/// All is computed here: no graphics card and no driver take part. Throws `Error` (usage) if the given camera is
/// invalid, or the size is not within 16 .. 8192 pixels.
[[nodiscard]] Drawing draw(const Picture& picture, PictureSize size = {});

}  // namespace subworld
