#include "rt/stop.hpp"

#include <execinfo.h>
#include <sys/time.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdio>

namespace subworld {

namespace {

std::atomic<int> stopped_by{0};
static_assert(std::atomic<int>::is_always_lock_free);
itimerval patience{};  // written before the handlers that read it are installed

void end_now(int) { _exit(0); }

void on_signal(int signal) {
  if (stop_signal() == 0 && (patience.it_value.tv_sec != 0 || patience.it_value.tv_usec != 0))
    setitimer(ITIMER_REAL, &patience, nullptr);
  request_stop(signal);
}

void end_by_force(int) {
  constexpr char kText[] = "error: still busy long after the request to stop; ended by force\n";
  [[maybe_unused]] const auto written = write(STDERR_FILENO, kText, sizeof kText - 1);
  _exit(1);
}

void handle_stop_signals(void (*handler)(int)) {
  struct sigaction action {};
  action.sa_handler = handler;
  sigemptyset(&action.sa_mask);
  for (const int signal : {SIGINT, SIGTERM}) sigaction(signal, &action, nullptr);
  struct sigaction before {};
  const bool under_nohup = sigaction(SIGHUP, nullptr, &before) == 0 && before.sa_handler == SIG_IGN;
  if (!under_nohup) sigaction(SIGHUP, &action, nullptr);
  for (const int lost : {SIGPIPE, SIGXFSZ}) std::signal(lost, SIG_IGN);  // the write fails, and says why
}

/// The system's own handling follows when it returns, so that the process ends by this signal.
void on_fault(int signal, siginfo_t* info, void*) {
  std::array<char, 120> text{};
  const int length = std::snprintf(text.data(), text.size(), "error: signal %d (code %d) at address %p, called by:\n",
                                   signal, info->si_code, info->si_addr);
  [[maybe_unused]] const auto written = write(STDERR_FILENO, text.data(), static_cast<std::size_t>(length));
  std::array<void*, 32> frames{};
  backtrace_symbols_fd(frames.data(), backtrace(frames.data(), frames.size()), STDERR_FILENO);
  std::raise(signal);
}

void report_faults() {
  void* loads_what_it_needs = nullptr;  // a handler may not
  backtrace(&loads_what_it_needs, 1);
  struct sigaction action {
  }, before{};
  action.sa_sigaction = on_fault;
  action.sa_flags = SA_SIGINFO | SA_RESETHAND;
  for (const int signal : {SIGBUS, SIGFPE, SIGILL, SIGSEGV}) {
    if (sigaction(signal, nullptr, &before) == 0 && before.sa_handler == SIG_DFL) sigaction(signal, &action, nullptr);
  }
}

}  // namespace

void end_at_stop_signals() {
  handle_stop_signals(end_now);
  report_faults();
}

void watch_stop_signals(double forced_after_s) {
  const double whole_s = std::floor(forced_after_s);
  patience.it_value = {static_cast<time_t>(whole_s), static_cast<suseconds_t>(1e6 * (forced_after_s - whole_s))};
  std::signal(SIGALRM, end_by_force);
  handle_stop_signals(on_signal);
}

int stop_signal() noexcept { return stopped_by.load(std::memory_order_relaxed); }

void request_stop(int signal) noexcept {
  int none = 0;
  stopped_by.compare_exchange_strong(none, signal);
}

}  // namespace subworld
