#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>

namespace subworld {

/// A message between the launcher of a run and its display, which shows the verdict to its viewers. The launcher judges
/// when the other programs have ended, and the display waits for that.
enum class VerdictMessage : std::uint8_t {
  closed,   ///< the other end is: no message follows
  awaited,  ///< by the display, when it has done all else: a viewer waits for the verdict
  over,     ///< by the launcher, in place of SIGTERM: the run is over
  written,  ///< by the launcher: the verdict is in the summary
};

/// Names the display's end in its environment.
inline constexpr const char* kVerdictLink = "SUBWORLD_VERDICT";

/// The ends of the launcher and of the display; a new program does not inherit them. -1: the system has none left.
[[nodiscard]] std::array<int, 2> make_verdict_link() noexcept;
/// The end of this display; -1: no launcher judges its run.
[[nodiscard]] int verdict_link_of_display() noexcept;

/// Where the other end is closed, nothing happens.
void send_verdict_message(int link, VerdictMessage message) noexcept;
/// Empty: none has come within this time.
[[nodiscard]] std::optional<VerdictMessage> receive_verdict_message(int link,
                                                                    std::chrono::milliseconds within = {}) noexcept;

}  // namespace subworld
