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

/// The bytes of a PNG file. Throws `Error` (failed) if the image's size and its bytes disagree.
[[nodiscard]] std::vector<std::uint8_t> encode_png(const Image& image);

/// Throws `Error` (failed) with the file's name and the reason.
void write_png(const std::string& file, const Image& image);

/// Throws `Error` (failed) with the file's name and the reason. Transparent pixels are blended over white.
[[nodiscard]] Image read_png(const std::string& file);

}  // namespace subworld
