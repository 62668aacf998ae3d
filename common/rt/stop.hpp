#pragma once

namespace subworld {

/// The longest that a program takes to end after it was asked to, s; then it is ended by force.
inline constexpr double kLongestEnd_s = 1.8;

/// From now on SIGINT, SIGTERM and SIGHUP end the process at once, with 0: for as long as it only loads. SIGPIPE is
/// ignored.
void end_at_stop_signals();

/// From now on SIGINT, SIGTERM and SIGHUP ask the process to stop instead of ending it. A process that still runs
/// `forced_after_s` after the first of them is ended by force, with 1; 0: never. SIGPIPE is ignored.
void watch_stop_signals(double forced_after_s = 0.0);

/// The first signal that asked, or 0. Safe at any rate.
[[nodiscard]] int stop_signal() noexcept;

/// Asks as a signal would.
void request_stop(int signal) noexcept;

}  // namespace subworld
