#include "results/run_report.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>

namespace subworld {

namespace fs = std::filesystem;

namespace {

constexpr std::uintmax_t kLargest_bytes = 8 << 20;
constexpr std::size_t kMostPictures = 12;

std::string base64(const std::string& bytes) {
  constexpr const char* kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t three = 0;
    for (std::size_t k = 0; k < 3; ++k)
      three = three << 8 | (i + k < bytes.size() ? static_cast<std::uint8_t>(bytes[i + k]) : 0U);
    for (std::size_t k = 0; k < 4; ++k) text += i + k > bytes.size() ? '=' : kDigits[three >> (18 - 6 * k) & 63];
  }
  return text;
}

/// Empty if the file is no picture.
std::string png_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(stream), {}};
  return bytes.starts_with("\x89PNG\r\n\x1a\n") ? bytes : "";
}

}  // namespace

std::string pictures_in(const std::string& folder) {
  std::vector<fs::path> files;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    if (entry.path().extension() == ".png" && entry.is_regular_file() && entry.file_size() <= kLargest_bytes)
      files.push_back(entry.path());
  }
  std::ranges::sort(files);
  if (files.size() > kMostPictures) files.resize(kMostPictures);
  std::string text;
  for (const fs::path& file : files) {
    const std::string png = png_of(file), name = escaped(file.filename().string());
    if (png.empty()) continue;
    text +=
        fmt::format("<figure><img alt=\"{}\" src=\"data:image/png;base64,{}\"><figcaption>{}</figcaption></figure>\n",
                    name, base64(png), name);
  }
  return text.empty() ? text : "<div class=pictures>\n" + text + "</div>\n";
}

}  // namespace subworld
