#pragma once

#include "lab/network/measure.hpp"

#include <string>

/// `ddsperf`, the measuring program of Cyclone DDS, over the network of a cell: as a second opinion on the lab.
namespace subworld {

/// Name of the baseline.
inline constexpr const char* kDdsperf = "ddsperf";

/// Throws `Error` (failed) with the cure where the program is not installed.
void require_ddsperf();

/// Round trips of `ddsperf ping` at the rate, payload and reliability of the cell, between two processes of Cyclone
/// DDS, s: {"p50", "p90", "p99", "max", "n"}. It prints half of the round trip, once a second: this is twice the median
/// over the seconds after the first. All but n are null for several users, and where fewer than nine of ten pings were
/// answered within the period, after which ddsperf drops them. Throws `Error` (failed) where the network cannot be
/// made.
[[nodiscard]] Json measure_ddsperf(const NetworkCell& cell, const NetworkRunSettings& settings);

/// The figures of what `ddsperf ping` has printed. `rate_hz` is the rate of its pings.
[[nodiscard]] Json ddsperf_figures(const std::string& text, double rate_hz);

}  // namespace subworld
