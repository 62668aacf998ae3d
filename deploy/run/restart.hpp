#pragma once

#include <cstdint>
#include <string>

namespace subworld {

/// When a program that ends before its run is started again.
enum class Restart : std::uint8_t {
  never,
  on_failure,  ///< killed, halted for a second, or with exit code 1
  always       ///< also one that was asked to end
};

/// A program that was started again.
struct Restarted {
  std::string program;   ///< "haptic_sim_0"
  double after_s = 0.0;  ///< since the launcher began to watch
  std::string reason;    ///< "killed by SIGKILL"
};

}  // namespace subworld
