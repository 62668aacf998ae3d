#pragma once

namespace subworld {

/// In each page, picture and video of ours, which another one may replace.
inline constexpr const char* kOwnMark = "Written by Subworld";

/// "0.1.0", the version of the CMake project.
[[nodiscard]] const char* version_text() noexcept;

}  // namespace subworld
