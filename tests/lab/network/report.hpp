#pragma once

#include "lab/network/criteria.hpp"
#include "lab/network/measure.hpp"

#include <string>
#include <vector>

namespace subworld {

/// The same network and load without the product.
struct Baseline {
  CellFindings udp = {};
  Json ddsperf = {};  ///< as `measure_ddsperf`; null: not measured
};

/// A row of the table.
[[nodiscard]] Json row_of(const NetworkCell& cell, const NetworkRunSettings& settings, const CellFindings& found,
                          const Baseline& baseline);
/// The command line that repeats a cell alone. Equal cells of equal settings have equal ones.
[[nodiscard]] std::string command_of(const NetworkCell& cell, const NetworkRunSettings& settings);
/// Whether the cell of the row could not be measured.
[[nodiscard]] bool failed(const Json& row);
/// "fastdds > cyclonedds"
[[nodiscard]] std::string pair_of(const Json& row);
/// For the progress: "lost 0.1 %, round trip p50 0.4 p99 1.2 ms, longest gap 12 ms", or the failure.
[[nodiscard]] std::string result_text(const Json& row);

/// The rows of each transport, link and reliability, in order.
[[nodiscard]] std::vector<Rows> by_network(const Rows& rows);
/// The rows of each link, in order.
[[nodiscard]] std::vector<Rows> by_link(const Rows& rows);

/// What the network carries, one sentence for each transport, link and reliability. A cell is carried if it passes the
/// requirements; without any, if at most one message in a hundred is lost beyond the share that the link loses of
/// best-effort packets.
[[nodiscard]] std::vector<std::string> sentences_of(const Rows& rows, const std::vector<Requirement>& requirements);

/// Writes one self-contained page. `felt`: the rows of what users felt. Throws `Error` (failed) if gnuplot is missing
/// or the file cannot be written.
void write_network_report(const std::string& path, const Rows& rows, const Rows& felt, const Json& summary);

}  // namespace subworld
