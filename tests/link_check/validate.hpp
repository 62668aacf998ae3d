#pragma once

#include "link/network.hpp"

#include <string>
#include <vector>

namespace subworld {

/// A quantity of a link, requested against measured.
struct LinkCheck {
  std::string quantity;
  double requested = 0.0;
  double measured = 0.0;
  double least = 0.0;  ///< of what is allowed
  double most = 0.0;
  std::string unit;
  std::string note = {};  ///< why it is not judged; empty: it is

  [[nodiscard]] bool ok() const noexcept { return !note.empty() || (measured >= least && measured <= most); }
};

struct LinkValidation {
  LinkEnds ends;
  std::vector<LinkCheck> checks;
  [[nodiscard]] bool ok() const noexcept;
};

/// Largest error of a delay that passes: this time, or this share of it.
inline constexpr double kDelayTolerance_s = 0.0002;
inline constexpr double kDelayTolerance = 0.02;
/// Standard errors by which a sample may differ: a right link fails one check in 10,000.
inline constexpr double kStandardErrors = 3.9;

struct LinkStatistics;
/// Judges what probes of `period_s` and `bytes` have measured of a link with these settings.
[[nodiscard]] std::vector<LinkCheck> judge(const LinkSettings& settings, const LinkStatistics& measured,
                                           double period_s, int bytes);

inline constexpr int kProbeBytes = 64;
/// Probes a second that measure the delay of a link: 1000, or as many as take half of its rate and of its queue.
[[nodiscard]] double probe_rate_hz(const LinkSettings& settings) noexcept;

/// Sends probes in both directions between the first two hosts for `duration_s`, then a burst for the rate,
/// and last 100 Mbit/s from the first to the second. An outage must not fall into this time. Throws `Error` (failed).
[[nodiscard]] std::vector<LinkValidation> validate(EmulatedNetwork& network, double duration_s);

/// The checks as a table, one line each.
[[nodiscard]] std::string table_of(const std::vector<LinkCheck>& checks);

}  // namespace subworld
