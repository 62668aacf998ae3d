#include "png_file.hpp"

#include "model/error.hpp"

#include <fmt/format.h>
#include <png.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>

namespace subworld {
namespace {

struct Close {
  void operator()(std::FILE* file) const noexcept { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, Close>;

// State of the library, freed on every return and exception.
struct PngImage : png_image {
  PngImage() noexcept : png_image{} { version = PNG_IMAGE_VERSION; }
  ~PngImage() { png_image_free(this); }
  PngImage(const PngImage&) = delete;
  PngImage& operator=(const PngImage&) = delete;
};

std::size_t byte_count(int width, int height) {
  return 3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
}

}  // namespace

std::vector<std::uint8_t> encode_png(const Image& image) {
  if (image.width <= 0 || image.height <= 0 || image.rgb.size() != byte_count(image.width, image.height)) {
    throw Error(ExitCode::failed, fmt::format("picture of {} x {} pixels with {} bytes: expected 3 bytes a pixel",
                                              image.width, image.height, image.rgb.size()));
  }
  PngImage png;
  png.width = static_cast<png_uint_32>(image.width);
  png.height = static_cast<png_uint_32>(image.height);
  png.format = PNG_FORMAT_RGB;
  std::vector<std::uint8_t> bytes(PNG_IMAGE_PNG_SIZE_MAX(png));
  png_alloc_size_t size = bytes.size();
  if (png_image_write_to_memory(&png, bytes.data(), &size, 0, image.rgb.data(), 0, nullptr) == 0) {
    throw Error(ExitCode::failed, fmt::format("cannot encode a PNG picture: {}", png.message));
  }
  bytes.resize(size);
  return bytes;
}

void write_png(const std::string& file, const Image& image) {
  const auto bytes = encode_png(image);
  File out{std::fopen(file.c_str(), "wb")};
  const bool written = out && std::fwrite(bytes.data(), 1, bytes.size(), out.get()) == bytes.size();
  // Closing flushes, so a full disk is reported only here.
  if (!written || std::fclose(out.release()) != 0) {
    throw Error(ExitCode::failed, fmt::format("{}: cannot write the picture: {}", file, std::strerror(errno)));
  }
}

Image read_png(const std::string& file) {
  PngImage png;
  if (png_image_begin_read_from_file(&png, file.c_str()) == 0) {
    throw Error(ExitCode::failed, fmt::format("{}: cannot read the picture: {}", file, png.message));
  }
  png.format = PNG_FORMAT_RGB;
  Image image{static_cast<int>(png.width), static_cast<int>(png.height), {}};
  image.rgb.resize(byte_count(image.width, image.height));
  const png_color white{255, 255, 255};
  if (png_image_finish_read(&png, &white, image.rgb.data(), 0, nullptr) == 0) {
    throw Error(ExitCode::failed, fmt::format("{}: cannot read the picture: {}", file, png.message));
  }
  return image;
}

}  // namespace subworld
