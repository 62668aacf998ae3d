#include "lab/network/statistics.hpp"

#include "io/results/json.hpp"

#include <algorithm>
#include <array>

namespace subworld {

namespace {

constexpr double kLeastBeyond = 10.0;

struct Percentile {
  const char* name;
  double q;
};
constexpr std::array kPercentiles{Percentile{"p50", 0.5}, Percentile{"p90", 0.9}, Percentile{"p99", 0.99},
                                  Percentile{"p99_9", 0.999}, Percentile{"p99_99", 0.9999}};

}  // namespace

void Arrivals::add(const Arrivals& other) noexcept {
  received += other.received;
  duplicates += other.duplicates;
  out_of_order += other.out_of_order;
  longest_burst = std::max(longest_burst, other.longest_burst);
  longest_gap_s = std::max(longest_gap_s, other.longest_gap_s);
  delay.add(other.delay);
}

void ArrivalBook::note_gap(std::int64_t from_ns, std::int64_t to_ns) noexcept {
  into_.longest_gap_s = std::max(into_.longest_gap_s, 1e-9 * static_cast<double>(to_ns - from_ns));
}

bool ArrivalBook::add(std::uint64_t number, std::int64_t now_ns, double delay_s) noexcept {
  if (number >= seen_.size()) return false;
  if (number < first_) {
    last_ns_ = now_ns;
    return false;
  }
  if (seen_[number]) {
    ++into_.duplicates;
    return false;
  }
  seen_[number] = true;
  ++into_.received;
  into_.delay.add(delay_s);
  if (number < newest_) ++into_.out_of_order;
  newest_ = std::max(newest_, number);
  if (last_ns_ == 0)
    first_arrival_ns_ = now_ns;
  else
    note_gap(last_ns_, now_ns);
  last_ns_ = now_ns;
  return true;
}

void ArrivalBook::close(std::uint64_t sent, std::int64_t begin_ns, std::int64_t end_ns) noexcept {
  if (first_arrival_ns_ != 0) note_gap(begin_ns, first_arrival_ns_);
  note_gap(std::max(last_ns_, begin_ns), end_ns);
  std::uint64_t burst = 0;
  for (std::uint64_t number = first_; number < std::min<std::uint64_t>(sent, seen_.size()); ++number) {
    burst = seen_[number] ? 0 : burst + 1;
    into_.longest_burst = std::max(into_.longest_burst, burst);
  }
}

Json percentiles(const Histogram& times) {
  const auto n = static_cast<double>(times.count());
  Json json;
  for (const auto& [name, q] : kPercentiles)
    json[name] = n * (1.0 - q) >= kLeastBeyond - 1e-6 ? Json(times.quantile_s(q)) : Json();
  json["max"] = times.count() > 0 ? Json(times.max_s()) : Json();
  json["mean"] = times.count() > 0 ? Json(times.mean_s()) : Json();
  json["n"] = times.count();
  return json;
}

}  // namespace subworld
