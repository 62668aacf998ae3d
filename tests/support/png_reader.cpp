#include "support/png_reader.hpp"

#include <png.h>

#include <stdexcept>

namespace subworld::test {

Image read_png(const std::string& file) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  const auto fail = [&] { throw std::runtime_error(file + ": cannot read the picture: " + png.message); };
  if (png_image_begin_read_from_file(&png, file.c_str()) == 0) fail();
  png.format = PNG_FORMAT_RGB;
  Image image{static_cast<int>(png.width), static_cast<int>(png.height), {}};
  image.rgb.resize(PNG_IMAGE_SIZE(png));
  const png_color white{255, 255, 255};
  if (png_image_finish_read(&png, &white, image.rgb.data(), 0, nullptr) == 0) fail();
  return image;
}

}  // namespace subworld::test
