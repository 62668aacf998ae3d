#pragma once

#include <cstdint>
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

/// Throws `Error` (failed) with the file's name and the reason, also if the image's size and its bytes disagree.
void write_png(const std::string& file, const Image& image);

}  // namespace subworld
