#include "link_check/statistics.hpp"

#include "link/model.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>

namespace subworld {

namespace {

double share(std::uint64_t part, std::uint64_t whole) noexcept {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

void count_bursts(const std::vector<bool>& seen, LinkStatistics& result) {
  std::uint64_t run = 0;
  for (const bool arrived : seen) {
    run = arrived ? 0 : run + 1;
    result.bursts += run == 1 ? 1 : 0;
    result.longest_burst = std::max(result.longest_burst, run);
  }
}

void count_moments(LinkStatistics& result) {
  const double n = static_cast<double>(result.delays_s.size());
  if (n == 0.0) return;
  for (const double delay : result.delays_s) result.delay_mean_s += delay / n;
  double second = 0.0;
  for (const double delay : result.delays_s) {
    const double square = (delay - result.delay_mean_s) * (delay - result.delay_mean_s);
    second += square / n;
    result.delay_fourth_moment_s4 += square * square / n;
  }
  result.delay_deviation_s = std::sqrt(second);
}

}  // namespace

double LinkStatistics::loss_ratio() const noexcept { return share(sent - received, sent); }
double LinkStatistics::duplicate_ratio() const noexcept { return share(duplicated, sent); }
double LinkStatistics::reorder_ratio() const noexcept { return share(reordered, received); }
double LinkStatistics::burst_mean() const noexcept { return share(sent - received, bursts); }

double LinkStatistics::quantile_s(double q) const noexcept {
  if (delays_s.empty()) return 0.0;
  const double at = std::clamp(q, 0.0, 1.0) * static_cast<double>(delays_s.size() - 1);
  return delays_s[static_cast<std::size_t>(std::lround(at))];
}

double burst_mean(const LossModel& loss) noexcept {
  const auto& [p, r, in_bad, in_good] = loss;
  const double bad = loss.bad_ratio(), lost = loss.loss_ratio();
  if (lost <= 0.0) return 0.0;
  // Probability that a packet and the one after it are lost.
  const double after_bad = r * in_good + (1.0 - r) * in_bad, after_good = p * in_bad + (1.0 - p) * in_good;
  const double begins = lost - bad * in_bad * after_bad - (1.0 - bad) * in_good * after_good;
  return begins <= 0.0 ? std::numeric_limits<double>::infinity() : lost / begins;
}

double loss_deviation(const LossModel& loss, double packets) noexcept {
  const double lost = loss.loss_ratio(), bad = loss.bad_ratio();
  const double memory = 1.0 - loss.p - loss.r;  // correlation of the states of two packets in a row
  const double step = loss.loss_in_bad - loss.loss_in_good;
  const double correlated =
      loss.p > 0.0 && memory < 1.0 ? 2.0 * step * step * bad * (1.0 - bad) * memory / (1.0 - memory) : 0.0;
  return packets > 0.0 ? std::sqrt(std::fmax(0.0, lost * (1.0 - lost) + correlated) / packets) : 0.0;
}

LinkStatistics statistics_of(std::span<const ProbeArrival> arrivals, std::uint64_t sent) {
  LinkStatistics result;
  result.sent = sent;
  std::vector<bool> seen(sent, false);
  std::uint32_t newest = 0;
  for (const ProbeArrival& one : arrivals) {
    if (one.number >= sent) continue;
    if (seen[one.number]) {
      ++result.duplicated;
      continue;
    }
    seen[one.number] = true;
    ++result.received;
    result.reordered += one.number < newest ? 1 : 0;
    newest = std::max(newest, one.number);
    result.delays_s.push_back(one.delay_s);
  }
  count_bursts(seen, result);
  count_moments(result);
  std::ranges::sort(result.delays_s);
  return result;
}

LinkStatistics expected_statistics(const LinkSettings& settings, std::uint64_t sent, double period_s, int bytes) {
  struct Copy {
    std::int64_t departure_ns;
    std::uint64_t order;
    std::uint32_t number;
    bool operator>(const Copy& other) const {
      return departure_ns != other.departure_ns ? departure_ns > other.departure_ns : order > other.order;
    }
  };
  constexpr std::uint64_t kSeed = 0x5eed;
  LinkModel model(settings, kSeed);
  std::priority_queue<Copy, std::vector<Copy>, std::greater<>> waiting;
  std::vector<ProbeArrival> arrivals;
  std::uint64_t order = 0;
  const auto sent_ns = [&](std::uint64_t number) { return std::llround(1e9 * period_s * static_cast<double>(number)); };
  const auto deliver = [&](std::int64_t until_ns) {
    for (; !waiting.empty() && waiting.top().departure_ns <= until_ns; waiting.pop()) {
      const Copy& copy = waiting.top();
      arrivals.push_back({copy.number, 1e-9 * static_cast<double>(copy.departure_ns - sent_ns(copy.number))});
      model.leave();
    }
  };
  for (std::uint64_t i = 0; i < sent; ++i) {
    deliver(sent_ns(i));
    const PacketFate fate = model.arrive(sent_ns(i), bytes);
    for (int c = 0; c < fate.copies; ++c) waiting.push({fate.departure_ns[c], order++, static_cast<std::uint32_t>(i)});
  }
  deliver(std::numeric_limits<std::int64_t>::max());
  return statistics_of(arrivals, sent);
}

}  // namespace subworld
