#pragma once

#include <chrono>
#include <cstdint>

namespace subworld {

/// Time of day, ns since 1970.
[[nodiscard]] inline std::int64_t wall_ns() noexcept {
  return std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count();
}

}  // namespace subworld
