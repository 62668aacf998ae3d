#pragma once

#include <array>
#include <cstdint>

namespace subworld {

/// Durations in a fixed amount of memory: 64 bins an octave from 10 ns to 1000 s, so a quantile is within 1.1 %.
class Histogram {
 public:
  void add(double seconds) noexcept;

  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  [[nodiscard]] double mean_s() const noexcept { return count_ == 0 ? 0.0 : sum_s_ / static_cast<double>(count_); }
  [[nodiscard]] double max_s() const noexcept { return max_s_; }
  /// q in 0 .. 1; 0 s for an empty histogram.
  [[nodiscard]] double quantile_s(double q) const noexcept;

 private:
  static constexpr int kBinsPerOctave = 64;
  static constexpr int kOctaves = 37;
  std::array<std::uint64_t, kBinsPerOctave * kOctaves> bins_{};
  std::uint64_t count_ = 0;
  double sum_s_ = 0.0;
  double max_s_ = 0.0;
};

}  // namespace subworld
