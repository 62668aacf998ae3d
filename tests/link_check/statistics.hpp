#pragma once

#include "link/settings.hpp"

#include <cstdint>
#include <span>
#include <vector>

namespace subworld {

/// A probe packet that has arrived.
struct ProbeArrival {
  std::uint32_t number = 0;  ///< of the sender, from 0
  double delay_s = 0.0;
};

/// What a sequence of probe packets shows of a link.
struct LinkStatistics {
  std::uint64_t sent = 0;
  std::uint64_t received = 0;  ///< without duplicates
  std::uint64_t duplicated = 0;
  std::uint64_t reordered = 0;  ///< that arrived after a later one
  std::uint64_t bursts = 0;     ///< runs of lost packets
  std::uint64_t longest_burst = 0;
  double delay_mean_s = 0.0;
  double delay_deviation_s = 0.0;
  double delay_fourth_moment_s4 = 0.0;  ///< central
  std::vector<double> delays_s;         ///< in ascending order

  [[nodiscard]] double loss_ratio() const noexcept;
  [[nodiscard]] double duplicate_ratio() const noexcept;
  [[nodiscard]] double reorder_ratio() const noexcept;
  [[nodiscard]] double burst_mean() const noexcept;
  /// q is clamped to 0 .. 1; 0 s without packets.
  [[nodiscard]] double quantile_s(double q) const noexcept;
};

/// Mean number of packets that are lost in a row; 0 without losses, infinite where all are lost.
[[nodiscard]] double burst_mean(const LossModel& loss) noexcept;
/// Standard deviation of the ratio of losses among `packets`: that of a binomial distribution, widened by the
/// correlation that the bad state causes.
[[nodiscard]] double loss_deviation(const LossModel& loss, double packets) noexcept;

/// `arrivals` in the order of arrival, of `sent` packets. Of duplicates the first counts.
[[nodiscard]] LinkStatistics statistics_of(std::span<const ProbeArrival> arrivals, std::uint64_t sent);

/// The statistics of a link that does exactly what `settings` request: `sent` packets of `bytes` each, one each
/// `period_s`, through a `LinkModel` with a seed of its own.
[[nodiscard]] LinkStatistics expected_statistics(const LinkSettings& settings, std::uint64_t sent, double period_s,
                                                 int bytes);

}  // namespace subworld
