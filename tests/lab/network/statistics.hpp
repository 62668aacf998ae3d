#pragma once

#include "io/results/results.hpp"
#include "rt/histogram.hpp"

#include <cstdint>
#include <vector>

namespace subworld {

/// What a receiver has seen of numbered messages. It has a fixed size, so that it can lie in shared memory.
struct Arrivals {
  std::uint64_t received = 0;  ///< without duplicates
  std::uint64_t duplicates = 0;
  std::uint64_t out_of_order = 0;   ///< that arrived after a later one
  std::uint64_t longest_burst = 0;  ///< messages that were lost in a row
  double longest_gap_s = 0.0;       ///< between two arrivals, and from the last one to the end of the sending
  Histogram delay;

  void add(const Arrivals& other) noexcept;
};

/// Counts the arrivals of the messages from number `first` on; the earlier ones belong to the start-up.
class ArrivalBook {
 public:
  ArrivalBook(Arrivals& into, std::uint64_t first, std::uint64_t most) : into_(into), first_(first), seen_(most) {}
  /// Allocates nothing. False if the message does not count: a duplicate, of the start-up, or not a number of ours.
  bool add(std::uint64_t number, std::int64_t now_ns, double delay_s) noexcept;
  /// `sent` messages were sent in all, the first that counts at `begin_ns` and the last at `end_ns`.
  void close(std::uint64_t sent, std::int64_t begin_ns, std::int64_t end_ns) noexcept;

 private:
  void note_gap(std::int64_t from_ns, std::int64_t to_ns) noexcept;
  Arrivals& into_;
  std::uint64_t first_;
  std::vector<bool> seen_;
  std::uint64_t newest_ = 0;
  std::int64_t last_ns_ = 0;           ///< 0: nothing has arrived
  std::int64_t first_arrival_ns_ = 0;  ///< arrival of the first message that counts, where none came before it
};

/// {"p50", "p90", "p99", "p99_9", "p99_99", "max", "mean", "n"}. A quantile q of n samples is null unless at least ten
/// of them lie beyond it: n (1 - q) >= 10. All but n are null without samples.
[[nodiscard]] Json percentiles(const Histogram& times);

}  // namespace subworld
