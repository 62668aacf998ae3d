#include "rt/histogram.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

namespace subworld {

namespace {

constexpr double kLowest_s = 1e-8;

}  // namespace

std::size_t Histogram::bin_of(double seconds) noexcept {
  const double octave = std::log2(std::max(seconds, kLowest_s) / kLowest_s);
  return std::min(static_cast<std::size_t>(octave * kBinsPerOctave), kBins - 1);
}

std::uint64_t Histogram::count_above(double seconds) const noexcept {
  return std::accumulate(bins_.begin() + static_cast<std::ptrdiff_t>(bin_of(seconds)) + 1, bins_.end(),
                         std::uint64_t{0});
}

void Histogram::add(const Histogram& other) noexcept {
  for (std::size_t i = 0; i < kBins; ++i) bins_[i] += other.bins_[i];
  count_ += other.count_;
  sum_s_ += other.sum_s_;
  max_s_ = std::max(max_s_, other.max_s_);
}

void Histogram::add(double seconds) noexcept {
  if (!std::isfinite(seconds)) return;
  ++bins_[bin_of(seconds)];
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
