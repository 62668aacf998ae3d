#pragma once

#include "io/options/options.hpp"
#include "wire/bus.hpp"

#include <functional>
#include <string>

namespace subworld {

/// Something of another program that a program waits for: "haptic_sim for user 0".
struct Wanted {
  std::string what;
  std::string start;  ///< the program that provides it, with its flags
};

/// Error text where it did not come in time, with the cure.
[[nodiscard]] std::string absent_text(const Wanted& wanted, const Options& options);

/// Waits until `there()` is true. Returns false when a signal requests a stop. Throws `Error` (failed) with the cure
/// when `options.wait_s` have passed since `coming()` was last true, if given, or else since the call.
bool wait_for(Bus& bus, const Options& options, const Wanted& wanted, const std::function<bool()>& there,
              const std::function<bool()>& coming = {});

}  // namespace subworld
