#pragma once

#include <map>
#include <string>
#include <vector>

namespace subworld {

/// The state of a program, as its files show it.
struct Sighting {
  std::string label;
  double time_s = 0.0;    ///< newest simulated time in its history
  std::string waits_for;  ///< the peer that it waits for, by its log; empty: none
};

/// Finds programs that do not advance although the run is not paused. Uses no file and no clock.
class Watchdog {
 public:
  /// Call every `passed_s`. Returns messages: a program that does not advance and waits for no peer is busy or stuck,
  /// and is named once.
  std::vector<std::string> look(const std::vector<Sighting>& programs, bool paused, double passed_s);

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
    double stalled_s = 0.0;
    bool named = false;
  };
  std::map<std::string, Clock> clocks_;
  Stall longest_;
};

/// The newest time in a history, from its last whole line; negative where there is none.
[[nodiscard]] double last_time_s(const std::string& history);
/// The peer that a program waits for, and whether a world is paused, by the last message of its log.
[[nodiscard]] std::string waits_for(const std::string& log);
[[nodiscard]] bool is_paused(const std::string& log);

}  // namespace subworld
