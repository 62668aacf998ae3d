#pragma once

#include "lab/network/felt.hpp"
#include "lab/network/measure.hpp"

#include <string>
#include <vector>

/// The lab from its first cell to the last.
namespace subworld {

struct NetworkRequest {
  NetworkAxes axes;
  NetworkRunSettings settings;
  FeltSettings felt;
  bool messages = true;                       ///< the matrix of messages
  std::vector<std::string> baselines{"udp"};  ///< names, or "off"
  bool resume = false;
  std::string out;

  [[nodiscard]] bool has_baseline(const std::string& name) const;
};

/// All cells of a request.
struct NetworkPlan {
  std::vector<NetworkCell> cells;
  std::vector<FeltCell> felt;

  [[nodiscard]] std::size_t size() const { return cells.size() + felt.size(); }
};
/// Throws `Error` (usage) for a link or a scene that cannot be read.
[[nodiscard]] NetworkPlan plan_of(const NetworkRequest& request);

struct NetworkRows {
  Rows cells;
  Rows felt;                   ///< one for each user of a cell
  std::size_t felt_cells = 0;  ///< that have been measured

  [[nodiscard]] std::size_t measured() const { return cells.size() + felt_cells; }
  [[nodiscard]] std::size_t failed_cells() const;
};

/// Measures the cells one after the other, and writes the results anew after each. A cell that cannot be measured has
/// the reason in its rows. With `resume`, the cells that the folder has are not measured again, except those that
/// failed. A stop request ends it early.
[[nodiscard]] NetworkRows measure_all(const NetworkPlan& plan, const NetworkRequest& request);

}  // namespace subworld
