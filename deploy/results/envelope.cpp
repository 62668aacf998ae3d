#include "results/envelope.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

void Envelope::add(double x, double y) {
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

void Envelope::merge() {
  for (std::size_t i = 0; i < kBins / 2; ++i) {
    const Bin &first = bins_[2 * i], &second = bins_[2 * i + 1];
    bins_[i] = {second.low.second < first.low.second ? second.low : first.low,
                second.high.second > first.high.second ? second.high : first.high};
  }
  bins_.resize(kBins / 2);
  per_bin_ *= 2;
}

double Envelope::largest() const noexcept {
  double largest = 0.0;
  for (const Bin& bin : bins_) largest = std::max(largest, bin.high.second);
  return largest;
}

std::vector<std::pair<double, double>> Envelope::points() const {
  std::vector<Point> points;
  for (const auto& [low, high] : bins_) {
    points.push_back(low.first <= high.first ? low : high);
    if (low.first != high.first) points.push_back(low.first <= high.first ? high : low);
  }
  return points;
}

}  // namespace subworld
