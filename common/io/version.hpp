#pragma once

namespace subworld {

/// In each page of a run or a lab: a page with it may be replaced by another one.
inline constexpr const char* kPageMark = "Written by Subworld";

/// "0.1.0", the version of the CMake project.
[[nodiscard]] const char* version_text() noexcept;

}  // namespace subworld
