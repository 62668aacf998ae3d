#pragma once

#include "model/messages/exchange.hpp"

#include <map>
#include <string>
#include <utility>

namespace subworld {

/// Finds programs that do not advance although the run is not paused, by their statuses alone.
class Watchdog {
 public:
  /// Takes a status that arrived at `now_s`. Returns a message, or an empty text: a program that does not advance and
  /// waits for no peer is busy or stuck, and is named once.
  std::string observe(const Status& status, double now_s);

  /// The longest time for which a named program did not advance.
  struct Stall {
    std::string label;
    double at_s = 0.0;
    double for_s = 0.0;
  };
  [[nodiscard]] const Stall& longest() const noexcept { return longest_; }

 private:
  struct Clock {
    double time_s = -1.0;
    double since_s = 0.0;  ///< when `time_s` was first seen, or the run was last paused
    bool named = false;
  };
  std::map<std::pair<ProgramKind, std::uint32_t>, Clock> clocks_;
  bool paused_ = false;
  Stall longest_;
};

}  // namespace subworld
