#pragma once

#include "lab/engines/run.hpp"

#include <chrono>
#include <map>
#include <string>
#include <vector>

namespace subworld {

/// A line for each run, with the time that the rest may take; more where one takes long.
class EngineProgress {
 public:
  explicit EngineProgress(const std::vector<EnginePoint>& points) : points_(points) {}
  /// Simulated so far of the point whose turn it is.
  void during(double t_s);
  /// Done with it.
  void after(const Json& row);

 private:
  using Clock = std::chrono::steady_clock;
  struct Rate {
    double work = 0.0;
    double seconds = 0.0;
  };
  /// "  about 3 min left" with `part` of the present point done.
  [[nodiscard]] std::string left(double part) const;
  [[nodiscard]] double expected_s(const EnginePoint& point) const;
  void say(const std::string& line);

  const std::vector<EnginePoint>& points_;
  std::size_t done_ = 0;
  std::map<std::string, Rate> rates_;       ///< by scene, engine and preset; "" of all
  Clock::time_point began_ = Clock::now();  ///< the present point
  Clock::time_point news_ = Clock::now();
};

}  // namespace subworld
