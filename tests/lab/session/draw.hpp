#pragma once

#include "model/hash.hpp"
#include "model/types.hpp"

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <initializer_list>
#include <numbers>
#include <random>

#include <fmt/core.h>

namespace subworld {

/// Random numbers that are equal on every platform: the standard fixes its generators, but not its distributions.
class Draw {
 public:
  explicit Draw(std::uint64_t seed) : bits_(seed) {}
  /// Stream number `index` of a seed, independent of the other streams.
  Draw(std::uint64_t seed, std::uint64_t index) : Draw(random_bits(random_bits(seed) + index)) {}

  double between(double low, double high) {
    return low + (high - low) * (static_cast<double>(bits_() >> 11) * 0x1p-53);
  }
  /// Uniform in the logarithm.
  double factor(double low, double high) { return std::exp(between(std::log(low), std::log(high))); }
  /// Both ends included.
  int whole(int low, int high) { return low + static_cast<int>(bits_() % static_cast<std::uint64_t>(high - low + 1)); }
  bool chance(double probability) { return between(0.0, 1.0) < probability; }
  template <class T>
  T one_of(std::initializer_list<T> choices) {
    return *(choices.begin() + whole(0, static_cast<int>(choices.size()) - 1));
  }
  Vec3 direction() {
    const double z = between(-1.0, 1.0), angle = between(0.0, 2.0 * std::numbers::pi);
    const double across = std::sqrt(1.0 - z * z);
    return {across * std::cos(angle), across * std::sin(angle), z};
  }

 private:
  std::mt19937_64 bits_;
};

/// Rounds to this number of significant digits: readable in a file, and independent of the last bit of a C library.
[[nodiscard]] inline double rounded(double value, int digits = 3) {
  return std::strtod(fmt::format("{:.{}g}", value, digits).c_str(), nullptr);
}
[[nodiscard]] inline Vec3 rounded(const Vec3& v, int digits = 3) {
  return {rounded(v.x(), digits), rounded(v.y(), digits), rounded(v.z(), digits)};
}

}  // namespace subworld
