#include "rt/histogram.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr double kLowest_s = 1e-8;

}  // namespace

void Histogram::add(double seconds) noexcept {
  if (!std::isfinite(seconds)) return;
  const double octave = std::log2(std::max(seconds, kLowest_s) / kLowest_s);
  const auto bin = static_cast<std::size_t>(octave * kBinsPerOctave);
  ++bins_[std::min(bin, bins_.size() - 1)];
  ++count_;
  sum_s_ += seconds;
  max_s_ = std::max(max_s_, seconds);
}

double Histogram::quantile_s(double q) const noexcept {
  if (count_ == 0) return 0.0;
  const auto wanted = static_cast<std::uint64_t>(std::ceil(std::clamp(q, 0.0, 1.0) * static_cast<double>(count_)));
  std::uint64_t seen = 0;
  for (std::size_t i = 0; i < bins_.size(); ++i) {
    seen += bins_[i];
    if (seen >= std::max<std::uint64_t>(wanted, 1)) {
      const double upper = kLowest_s * std::exp2((static_cast<double>(i) + 1.0) / kBinsPerOctave);
      return std::min(upper, max_s_);
    }
  }
  return max_s_;
}

}  // namespace subworld
