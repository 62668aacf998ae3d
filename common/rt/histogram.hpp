#pragma once

#include <array>
#include <cstdint>

namespace subworld {

/// Histogram of durations in constant memory: 64 bins an octave from 10 ns to 1000 s, so a quantile is within 1.1 %.
class Histogram {
 public:
  void add(double seconds) noexcept;
  void add(const Histogram& other) noexcept;

  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  [[nodiscard]] double mean_s() const noexcept { return count_ == 0 ? 0.0 : sum_s_ / static_cast<double>(count_); }
  [[nodiscard]] double sum_s() const noexcept { return sum_s_; }
  [[nodiscard]] double max_s() const noexcept { return max_s_; }
  /// q in 0 .. 1; 0 s for an empty histogram.
  [[nodiscard]] double quantile_s(double q) const noexcept;
  /// Number of durations above `seconds`, within the width of a bin.
  [[nodiscard]] std::uint64_t count_above(double seconds) const noexcept;

 private:
  [[nodiscard]] static std::size_t bin_of(double seconds) noexcept;

  static constexpr int kBinsPerOctave = 64;
  static constexpr int kOctaves = 37;
  static constexpr std::size_t kBins = kBinsPerOctave * kOctaves;
  std::array<std::uint64_t, kBins> bins_{};
  std::uint64_t count_ = 0;
  double sum_s_ = 0.0;
  double max_s_ = 0.0;
};

}  // namespace subworld
