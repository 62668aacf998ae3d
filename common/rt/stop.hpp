#pragma once

namespace subworld {

/// Longest time that a program may take to end after the request to stop, s. After it the program is ended by force.
inline constexpr double kLongestEnd_s = 1.8;

/// From now on SIGINT, SIGTERM and SIGHUP end the process at once, with exit code 0. For use while a program loads.
/// SIGPIPE and SIGXFSZ are ignored: the write fails. A fault (SIGBUS, SIGFPE, SIGILL, SIGSEGV) writes its address and
/// the calls that led to it to the standard error output, then ends the process.
void end_at_stop_signals();

/// From now on SIGINT, SIGTERM and SIGHUP request a stop instead of ending the process. A process that still runs
/// `forced_after_s` after the first request is ended by force, with exit code 1; 0: never. SIGPIPE and SIGXFSZ are
/// ignored.
void watch_stop_signals(double forced_after_s = 0.0);

/// The first signal that requested a stop, or 0. Safe at any rate.
[[nodiscard]] int stop_signal() noexcept;

/// Requests a stop as a signal does.
void request_stop(int signal) noexcept;

}  // namespace subworld
