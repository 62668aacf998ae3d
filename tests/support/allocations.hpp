#pragma once

namespace subworld::test {

/// How often this program has called `operator new`. Linking the source file replaces that operator.
[[nodiscard]] long allocations() noexcept;

}  // namespace subworld::test
