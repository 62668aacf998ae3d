#include "lab/stability/search.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>

namespace subworld {

namespace {
constexpr double kNotBracketed = std::numeric_limits<double>::quiet_NaN();
}

bool Bracket::inside() const { return std::isfinite(held) && std::isfinite(failed); }

double Bracket::middle() const { return inside() ? std::sqrt(held * failed) : proven(); }

double Bracket::proven() const { return std::isfinite(held) ? held : failed; }

Bracket find_limit(const Search& search, const std::function<bool(double)>& holds) {
  if (!(search.from > 0.0) || !(search.to > 0.0) || !(search.stride > 1.0) || !(search.precision > 1.0))
    throw std::invalid_argument("a search needs positive values, and a stride and a precision above 1");
  const bool upwards = search.to > search.from;
  const double stride = upwards ? search.stride : 1.0 / search.stride;
  const auto within = [&](double value) { return upwards ? value < search.to : value > search.to; };

  Bracket bracket{.held = kNotBracketed, .failed = kNotBracketed, .upwards = upwards};
  for (double value = search.from;;) {
    ++bracket.trials;
    if (!holds(value)) {
      bracket.failed = value;
      break;
    }
    bracket.held = value;
    if (!within(value)) break;
    value = within(value * stride) ? value * stride : search.to;
  }
  while (bracket.inside() && std::abs(std::log(bracket.failed / bracket.held)) > std::log(search.precision)) {
    ++bracket.trials;
    const double value = bracket.middle();
    (holds(value) ? bracket.held : bracket.failed) = value;
  }
  return bracket;
}

}  // namespace subworld
