#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace subworld {

/// A long curve in few points: the least and the largest value of each of at most `kBins` intervals, so that no peak is
/// lost. The intervals hold equally many points, and are merged in pairs when there are too many.
class Envelope {
 public:
  static constexpr std::size_t kBins = 720;  ///< a pixel of a plot each; even

  /// A point; values that are not finite are skipped.
  void add(double x, double y) {
    if (!std::isfinite(x) || !std::isfinite(y)) return;
    if (bins_.empty() || in_last_ == per_bin_) {
      if (bins_.size() == kBins) merge();
      bins_.push_back({{x, y}, {x, y}});
      in_last_ = 0;
    }
    Bin& bin = bins_.back();
    if (y < bin.low.second) bin.low = {x, y};
    if (y > bin.high.second) bin.high = {x, y};
    ++in_last_;
  }
  [[nodiscard]] bool empty() const noexcept { return bins_.empty(); }
  /// The largest value; 0 where there is none.
  [[nodiscard]] double largest() const noexcept {
    double largest = 0.0;
    for (const Bin& bin : bins_) largest = std::max(largest, bin.high.second);
    return largest;
  }
  /// In the order of x.
  [[nodiscard]] std::vector<std::pair<double, double>> points() const {
    std::vector<Point> points;
    for (const auto& [low, high] : bins_) {
      points.push_back(low.first <= high.first ? low : high);
      if (low.first != high.first) points.push_back(low.first <= high.first ? high : low);
    }
    return points;
  }

 private:
  using Point = std::pair<double, double>;
  struct Bin {
    Point low, high;
  };
  void merge() {
    for (std::size_t i = 0; i < kBins / 2; ++i) {
      const Bin &first = bins_[2 * i], &second = bins_[2 * i + 1];
      bins_[i] = {second.low.second < first.low.second ? second.low : first.low,
                  second.high.second > first.high.second ? second.high : first.high};
    }
    bins_.resize(kBins / 2);
    per_bin_ *= 2;
  }

  std::vector<Bin> bins_;
  std::size_t per_bin_ = 1, in_last_ = 0;
};

}  // namespace subworld
