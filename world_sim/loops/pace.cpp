#include "world_sim/loops/pace.hpp"

#include <algorithm>

namespace subworld {

namespace {

constexpr double kFilter = 0.125;         ///< of a new cost in the smoothed one
constexpr double kCaughtUp_cycles = 2.0;  ///< most lateness that a clock at full speed catches up with
constexpr double kRecovers = 1.05;  ///< the clock rises where the target is so much above it: less would be ripple
constexpr double kHard = 3.0;       ///< times the cost: the clock falls at once
constexpr double kSettled_s = 0.2;  ///< a factor that lasts is news, one on the way is not
constexpr double kQuiet_s = 1.0;    ///< at full speed before the overload counts as over

}  // namespace

void Pace::observe(double cost_s) noexcept {
  newest_costs_s_[cycles_ % newest_costs_s_.size()] = cost_s;
  ++cycles_;
  // The median leaves single stalls out.
  const std::size_t known = std::min(cycles_, newest_costs_s_.size());
  auto sorted = newest_costs_s_;
  std::sort(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(known));
  const double median_s = sorted[(known - 1) / 2];
  const bool at_once = known < newest_costs_s_.size() || median_s > kHard * cost_s_;
  cost_s_ += (at_once ? 1.0 : kFilter) * (median_s - cost_s_);
}

double Pace::cycle(double cost_s, double late_s) noexcept {
  observe(cost_s);
  const double period = period_s();
  if (!slowed_ && cycles_ > 2 && late_s > cycle_s_ && cost_s_ > cycle_s_) slowed_ = true;

  double slip_s = 0.0;
  if (slowed_) {
    const double target = std::clamp(kShare * cycle_s_ / cost_s_, kLeastRealTimeFactor, 1.0);
    const bool near_target = factor_ <= kRecovers * target;
    at_target_s_ = near_target ? at_target_s_ + period : 0.0;
    if (factor_ > kHard * target) {
      factor_ = target;
    } else if (target < factor_) {
      factor_ = std::max(target, (1.0 - kStep) * factor_);
    } else if (target >= 1.0 || target > kRecovers * factor_) {
      factor_ = std::min(target, (1.0 + kStep) * factor_);
    }
    // A slowed clock catches up with nothing, and the rest of a cycle stays free also where the cycle is over.
    const double rest_s = (1.0 - kShare) * std::min(cost_s, cost_s_);
    slip_s = late_s > 0.0 ? late_s + rest_s : 0.0;
    if (factor_ >= 1.0) slowed_ = false;
  } else {
    slip_s = std::max(0.0, late_s - kCaughtUp_cycles * cycle_s_);
  }
  steady_s_ = slowed_ ? 0.0 : steady_s_ + period;
  if (!slowed_) at_target_s_ = 0.0;
  return slip_s;
}

Pace::News Pace::take_news() noexcept {
  News now = said_;
  if (slowed_ && at_target_s_ >= kSettled_s) {
    now = stuck() ? News::stuck : News::slowed;
    // Back and forth across the floor is no news.
    if (said_ == News::stuck && now == News::slowed) now = News::stuck;
  } else if (steady_s_ >= kQuiet_s) {
    now = News::recovered;
  }
  if (now == said_) return News::none;
  said_ = now;
  return now;
}

}  // namespace subworld
