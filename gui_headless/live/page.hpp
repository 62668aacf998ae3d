#pragma once

#include <cstdint>
#include <span>

namespace subworld::live {

/// The page of web/, as compressed HTML. Empty in a build without Node.js. Generated in the build folder.
[[nodiscard]] std::span<const std::uint8_t> page_gzip() noexcept;

}  // namespace subworld::live
