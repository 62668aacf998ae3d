#pragma once

#include <algorithm>
#include <functional>
#include <ranges>

namespace subworld {

/// Iterator of the element with this key in a list sorted by it; its end if there is none.
template <std::ranges::forward_range List, class Key, class Projection = std::identity>
[[nodiscard]] constexpr auto find_sorted(List& list, const Key& key, Projection key_of = {}) {
  const auto at = std::ranges::lower_bound(list, key, {}, key_of);
  return at != std::ranges::end(list) && std::invoke(key_of, *at) == key ? at : std::ranges::end(list);
}

}  // namespace subworld
