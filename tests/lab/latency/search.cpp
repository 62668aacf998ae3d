#include "lab/latency/search.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr std::ptrdiff_t kBeyond = 2;  ///< delays of the grid that are measured after every user has failed

}  // namespace

DelaySearch::DelaySearch(const DelayRange& range, std::size_t users) : range_(range), users_(users), grid_{0} {
  for (double delay = std::pow(range.stride, range.phase); delay < range.largest; delay *= range.stride) {
    const int steps = static_cast<int>(std::lround(delay));
    if (steps > grid_.back() && steps < range.largest) grid_.push_back(steps);
  }
  grid_.push_back(range.largest);
}

DelaySearch::Interval DelaySearch::interval_of(std::size_t user) const {
  Interval interval;
  for (const auto& [delay, within] : measured_) {
    if (!within[user]) {
      interval.failed = delay;
      break;
    }
    interval.within = delay;
  }
  return interval;
}

bool DelaySearch::all_failed_long_ago() const {
  int last = 0;
  for (std::size_t u = 0; u < users_; ++u) {
    const Interval interval = interval_of(u);
    const bool failed_at_0 = measured_.contains(0) && !measured_.at(0)[u];
    if (interval.failed == 0 && !failed_at_0) return false;
    last = std::max(last, interval.failed);
  }
  return std::ranges::count_if(grid_, [&](int delay) { return delay > last && measured_.contains(delay); }) >= kBeyond;
}

std::optional<int> DelaySearch::next() const {
  if (!all_failed_long_ago()) {
    for (const int delay : grid_) {
      if (!measured_.contains(delay)) return delay;
    }
  }
  for (std::size_t u = 0; u < users_; ++u) {
    const auto [within, failed] = interval_of(u);
    if (failed - within <= 1 || failed <= range_.precision * within) continue;
    const int middle = static_cast<int>(std::lround(std::sqrt(static_cast<double>(std::max(within, 1)) * failed)));
    return std::clamp(middle, within + 1, failed - 1);
  }
  return std::nullopt;
}

void DelaySearch::add(int delay, const std::vector<bool>& within) { measured_[delay] = within; }

std::size_t DelaySearch::most() const {
  const double halvings = std::ceil(std::log2(std::log(range_.stride) / std::log(range_.precision)));
  return grid_.size() + users_ * static_cast<std::size_t>(std::max(0.0, halvings));
}

}  // namespace subworld
