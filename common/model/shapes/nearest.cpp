#include "model/shapes/nearest.hpp"

#include <algorithm>
#include <cstddef>
#include <numeric>

namespace subworld {

namespace {

/// Levenshtein distance.
std::size_t edits(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0]++;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t changed = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({changed, diagonal + 1, row[j] + 1});
    }
  }
  return row.back();
}

std::string_view stem(std::string_view key) { return key.substr(0, key.find('_')); }

constexpr std::size_t kLongestWord = 80;  // characters; a longer word is not a misspelt name

}  // namespace

std::string_view nearest(std::string_view word, const std::vector<std::string_view>& candidates) {
  std::string_view best;
  std::size_t least = std::max<std::size_t>(2, word.size() / 2);
  if (word.size() > kLongestWord) return best;
  for (std::string_view candidate : candidates) {
    std::size_t distance = edits(word, candidate);
    // A wrong or missing unit is the most frequent mistake: an equal word before the unit counts as near.
    if (stem(word) == stem(candidate)) distance = std::min<std::size_t>(distance, 2);
    if (distance < least || (distance == least && best.empty())) {
      least = distance;
      best = candidate;
    }
  }
  return best;
}

}  // namespace subworld
