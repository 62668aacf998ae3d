#pragma once

#include <string>
#include <string_view>

namespace subworld {

/// The text as a terminal or a JSON file can show it: UTF-8 without control characters but line feeds and tabs. Each
/// other byte is replaced by a question mark.
[[nodiscard]] std::string readable(std::string_view text);

}  // namespace subworld
