#pragma once

#include "io/results.hpp"
#include "model/scene.hpp"

#include <string>
#include <vector>

namespace subworld {

/// One measured quantity against its bar.
struct Gate {
  std::string name;
  double value = 0.0;
  double bar = 0.0;
  bool at_most = true;
  const char* unit = "";
  double scale = 1.0;        ///< from SI to the unit
  std::string warning = {};  ///< not empty: a missed bar is said in these words, and the verdict stays

  [[nodiscard]] bool ok() const noexcept { return at_most ? value <= bar : value >= bar; }
  [[nodiscard]] std::string line() const;
};

/// What ran, its effective settings and the parts that the programs wrote into the folder.
[[nodiscard]] Json summarise(const Scene& scene, const std::string& dds, const std::string& folder);

/// What a run is held against: in real time deadlines, lateness, lost frames and the world's clock; in lock-step loss
/// alone.
[[nodiscard]] std::vector<Gate> gates(const Json& summary);

/// The run in a few lines for a reader.
void print_summary(const Json& summary);

}  // namespace subworld
