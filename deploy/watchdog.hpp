#pragma once

#include <map>
#include <string>
#include <vector>

namespace subworld {

/// What can be seen of a program from outside.
struct Sighting {
  std::string label;
  double time_s = 0.0;    ///< newest simulated time in its history
  std::string waits_for;  ///< who it says that it waits for; empty: nobody
};

/// Names whose clock stands while nobody has paused it. Knows no file and no clock.
class Watchdog {
 public:
  /// Once every `passed_s`. Returns what there is to say, a line for each program: who stands and does not wait for
  /// another one is stuck, and is named once.
  std::vector<std::string> look(const std::vector<Sighting>& programs, bool paused, double passed_s);

  /// Time for which somebody stood who was named, s, and who, with the longest first.
  struct Stood {
    std::string label;
    double at_s = 0.0;
    double for_s = 0.0;
  };
  [[nodiscard]] const Stood& longest() const noexcept { return longest_; }

 private:
  struct Clock {
    double time_s = -1.0;
    double stands_s = 0.0;
    bool named = false;
  };
  std::map<std::string, Clock> clocks_;
  Stood longest_;
};

/// The newest time in a history, from its last whole line; negative where there is none.
[[nodiscard]] double last_time_s(const std::string& history);
/// Who a program waits for and whether a world is paused, by the last that its log says of it.
[[nodiscard]] std::string waits_for(const std::string& log);
[[nodiscard]] bool is_paused(const std::string& log);

}  // namespace subworld
