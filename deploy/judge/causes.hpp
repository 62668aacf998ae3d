#pragma once

#include "judge/gates.hpp"
#include "judge/summary.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstdint>
#include <string>

namespace subworld {

/// What a gate looks at: the run, and one of its users.
struct UserOfRun {
  const RunResults& run;
  std::size_t at = 0;  ///< of its results: one who took no part has none
  std::size_t user = run.haptic[at].user;

  [[nodiscard]] const Settings& settings() const { return run.scene.settings; }
  [[nodiscard]] const HapticResult& haptic() const { return run.haptic[at]; }
  [[nodiscard]] const DeviceResult& device() const { return run.device[at]; }
  [[nodiscard]] const DeviceSpec& spec() const { return run.scene.users[user].device; }
  /// Steps of the haptic loop, with the skipped ones.
  [[nodiscard]] double periods() const {
    return std::max(1.0, static_cast<double>(haptic().steps + haptic().skipped_steps));
  }
  [[nodiscard]] double of_steps(std::uint64_t count) const { return static_cast<double>(count) / periods(); }
  [[nodiscard]] std::string name() const { return fmt::format("user {}: ", user); }
};

/// Why the OS did not run a loop in time in `delayed` of its `steps`, by `lost_s` in all, although it wakes
/// `usual_late_s` late as a rule. Other loops of the run, more than the OS, are the cause where all of this holds:
///  * nothing else uses the machine, as far as that was measured;
///  * a bare loop was late less often;
///  * the loop waited longer for a core than it lost, typical wake-ups not counted;
///  * a program of the run could take that core: a rival of at least the loop's priority, or, for a loop without
///    real-time priority on cores that the run fills, any.
/// First of all, a control group whose share the run has used up is the cause.
[[nodiscard]] Cause by_late_wake_ups(const char* who, const MachineShare& machine, double usual_late_s,
                                     std::uint64_t delayed, double steps, double lost_s, bool has_rivals,
                                     const RunResults& run);
/// Why a loop's own steps miss deadlines.
[[nodiscard]] Cause by_own_steps(const UserOfRun& at);
[[nodiscard]] Cause by_slow_cycles(const RunResults& run);
/// " (link: delay 20ms)": what delayed the messages on their way, as far as the run made it itself; else empty.
[[nodiscard]] std::string link_text(const RunResults& run);
/// Why frames of the world did not reach a sub-world. In real time its reader holds a few frames, so one that was
/// halted for longer loses the others.
[[nodiscard]] Cause by_loss(const UserOfRun& at);
/// What makes the coupling of a user stable again.
[[nodiscard]] std::string coupling_cure(const UserOfRun& at);

}  // namespace subworld
