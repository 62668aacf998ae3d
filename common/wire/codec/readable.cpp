#include "wire/codec/readable.hpp"

#include <cstddef>
#include <cstdint>

namespace subworld {

namespace {

/// Bytes of the UTF-8 character with which the text begins; 0: it begins with none.
std::size_t bytes_of_character(std::string_view text) {
  const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<std::uint8_t>(text[i]) : 0U; };
  const std::uint32_t first = byte(0);
  if (first < 0x80) return 1;
  if (first < 0xc0) return 0;
  const std::size_t bytes = first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : 2;
  constexpr std::uint32_t kLeast[] = {0x80, 0x800, 0x10000};  // of a character that needs so many bytes
  std::uint32_t code = first & (0x7fU >> bytes);
  for (std::size_t i = 1; i < bytes; ++i) {
    if ((byte(i) & 0xc0U) != 0x80) return 0;
    code = code << 6U | (byte(i) & 0x3fU);
  }
  const bool surrogate = code >= 0xd800 && code <= 0xdfff;
  return first < 0xf8 && code >= kLeast[bytes - 2] && code <= 0x10ffff && !surrogate ? bytes : 0;
}

bool is_control(char c) { return (static_cast<std::uint8_t>(c) < 0x20 && c != '\n' && c != '\t') || c == 0x7f; }

}  // namespace

std::string readable(std::string_view text) {
  std::string shown;
  shown.reserve(text.size());
  while (!text.empty()) {
    const std::size_t bytes = bytes_of_character(text);
    if (bytes == 0 || is_control(text.front())) {
      shown += '?';
      text.remove_prefix(1);
    } else {
      shown += text.substr(0, bytes);
      text.remove_prefix(bytes);
    }
  }
  return shown;
}

}  // namespace subworld
