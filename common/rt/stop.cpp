#include "rt/stop.hpp"

#include <atomic>
#include <csignal>

namespace subworld {

namespace {

std::atomic<int> stopped_by{0};
static_assert(std::atomic<int>::is_always_lock_free);

void on_signal(int signal) { request_stop(signal); }

}  // namespace

void watch_stop_signals() {
  struct sigaction action {};
  action.sa_handler = on_signal;
  sigemptyset(&action.sa_mask);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaction(signal, &action, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
}

int stop_signal() noexcept { return stopped_by.load(std::memory_order_relaxed); }

void request_stop(int signal) noexcept {
  int none = 0;
  stopped_by.compare_exchange_strong(none, signal);
}

}  // namespace subworld
