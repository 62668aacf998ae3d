#pragma once

#include <fmt/core.h>

#include <string>
#include <string_view>

namespace subworld {

/// The items with `separator` between them, each as `form` writes it.
template <class Items>
[[nodiscard]] std::string joined(const Items& items, std::string_view separator, fmt::string_view form = "{}") {
  std::string text;
  bool first = true;
  for (const auto& item : items) {
    if (!first) text += separator;
    first = false;
    text += fmt::vformat(form, fmt::make_format_args(item));
  }
  return text;
}

}  // namespace subworld
