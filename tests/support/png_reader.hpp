#pragma once

#include "picture.hpp"

namespace subworld::test {

/// Throws `std::runtime_error` with the file's name and the reason. Transparent pixels are blended over white.
[[nodiscard]] Image read_png(const std::string& file);

}  // namespace subworld::test
