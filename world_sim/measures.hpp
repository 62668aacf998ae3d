#pragma once

#include "io/history.hpp"
#include "io/results.hpp"
#include "rt/histogram.hpp"
#include "world_sim/world.hpp"

#include <string>

namespace subworld {

/// What the world process says of itself at the end, and its history on the way.
class WorldMeasures {
 public:
  /// `folder` may be empty: nothing is written.
  WorldMeasures(const std::string& folder, History::Flush flush);

  void cycle(const World& world, double step_s, double lateness_s, bool late, double clock_factor) noexcept;
  void engine_changed(const EngineChange& change) { engine_changes_.push_back(to_json(change)); }
  void lost_report() noexcept { ++lost_reports_; }
  void refused_report() noexcept { ++refused_reports_; }

  [[nodiscard]] std::uint64_t cycles() const noexcept { return cycles_; }
  [[nodiscard]] std::uint64_t late() const noexcept { return late_; }
  [[nodiscard]] Json json(const World& world, std::size_t bodies, double settle_s) const;

 private:
  History history_;
  Histogram step_, lateness_;
  std::uint64_t cycles_ = 0, late_ = 0, lost_reports_ = 0, refused_reports_ = 0;
  double clock_factor_min_ = 1.0;
  Json engine_changes_ = Json::array();
};

}  // namespace subworld
