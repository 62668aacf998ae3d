#include "plan/listed.hpp"

#include "model/joined.hpp"

#include <fmt/core.h>

#include <algorithm>

namespace subworld {

std::string listed(const std::vector<std::string>& items) {
  constexpr std::size_t kMostListed = 10;  // in one warning
  const std::size_t shown = std::min(items.size(), kMostListed);
  const std::string text = joined(std::span(items).first(shown), ", ");
  return items.size() > shown ? fmt::format("{} and {} more", text, items.size() - shown) : text;
}

}  // namespace subworld
