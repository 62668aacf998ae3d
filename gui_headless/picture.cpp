#include "picture.hpp"

#include "figure.hpp"
#include "model/error.hpp"
#include "render.hpp"

#include <fmt/core.h>
#include <png.h>

#include <algorithm>

namespace subworld {

Drawing draw(const Picture& picture, PictureSize size) {
  if (std::min(size.width, size.height) < 16 || std::max(size.width, size.height) > 8192) {
    throw Error(ExitCode::usage, fmt::format("picture of {} x {} pixels: width and height must lie within 16 .. 8192",
                                             size.width, size.height));
  }
  const Figure figure = compose(picture, size);
  return {render(figure, size), figure.camera, figure.line_m_per_n_s, figure.omitted};
}

void write_png(const std::string& file, const Image& image) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.width);
  png.height = static_cast<png_uint_32>(image.height);
  png.format = PNG_FORMAT_RGB;
  if (image.width <= 0 || image.height <= 0 || image.rgb.size() != PNG_IMAGE_SIZE(png)) {
    throw Error(ExitCode::failed, fmt::format("{}: picture of {} x {} pixels with {} bytes: expected 3 bytes a pixel",
                                              file, image.width, image.height, image.rgb.size()));
  }
  if (png_image_write_to_file(&png, file.c_str(), 0, image.rgb.data(), 0, nullptr) == 0)
    throw Error(ExitCode::failed, fmt::format("{}: cannot write the picture: {}", file, png.message));
}

}  // namespace subworld
