#pragma once

#include "lab/engines/run.hpp"

#include <chrono>
#include <map>
#include <string>
#include <vector>

namespace subworld {

/// Prints a line for each run, with the estimated remaining time; more lines for a long run.
class EngineProgress {
 public:
  explicit EngineProgress(const std::vector<EnginePoint>& points) : points_(points) {}
  /// Simulated time of the current point.
  void during(double t_s);
  /// The current point is done.
  void after(const Json& row);

 private:
  using Clock = std::chrono::steady_clock;
  struct Rate {
    double work = 0.0;
    double seconds = 0.0;
  };
  /// "  about 3 min left" with the share `part` of the current point done.
  [[nodiscard]] std::string left(double part) const;
  [[nodiscard]] double expected_s(const EnginePoint& point) const;
  void say(const std::string& line);

  const std::vector<EnginePoint>& points_;
  std::size_t done_ = 0;
  std::map<std::string, Rate> rates_;       ///< by scene, engine and preset; "" for all
  Clock::time_point began_ = Clock::now();  ///< start of the current point
  Clock::time_point news_ = Clock::now();
};

}  // namespace subworld
