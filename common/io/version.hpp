#pragma once

namespace subworld {

/// "0.1.0", the version of the CMake project.
[[nodiscard]] const char* version_text() noexcept;

}  // namespace subworld
