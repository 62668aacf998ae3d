#pragma once

namespace subworld {

/// From now on SIGINT, SIGTERM and SIGHUP ask the process to stop instead of ending it, and SIGPIPE is ignored.
void watch_stop_signals();

/// The first signal that asked, or 0. Safe at any rate.
[[nodiscard]] int stop_signal() noexcept;

/// Asks as a signal would.
void request_stop(int signal) noexcept;

}  // namespace subworld
