#pragma once

#include <string_view>
#include <vector>

namespace subworld {

/// The candidate that needs the fewest edits to become `word`; empty if none is near.
[[nodiscard]] std::string_view nearest(std::string_view word, const std::vector<std::string_view>& candidates);

}  // namespace subworld
