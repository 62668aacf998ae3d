#include "physics/workers.hpp"

namespace subworld {

namespace {

/// Parts of a loop follow each other within microseconds; waking a thread takes ten times as long.
constexpr int kSpins = 2000;
constexpr std::uint64_t kJob = std::uint64_t{1} << 32;
constexpr std::uint64_t kParts = kJob - 1;

void relax() noexcept {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#endif
}

/// Waits until `of` differs from `old`: for a while awake, then asleep.
template <class Value>
void await_change(const std::atomic<Value>& of, Value old) noexcept {
  for (int i = 0; i < kSpins; ++i) {
    if (of.load(std::memory_order_acquire) != old) return;
    relax();
  }
  of.wait(old, std::memory_order_acquire);
}

}  // namespace

Workers::Workers(int threads) {
  for (int i = 1; i < threads; ++i) threads_.emplace_back([this] { work(); });
}

Workers::~Workers() {
  stops_ = true;
  parts_ += kJob;
  parts_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void Workers::run(const Job& job) {
  job_ = job;
  const std::size_t parts = (job.count + job.grain - 1) / job.grain;
  undone_.store(static_cast<std::uint32_t>(parts), std::memory_order_relaxed);
  const std::uint64_t last = parts_.load(std::memory_order_relaxed);
  parts_.store((last & ~kParts) + kJob + parts, std::memory_order_release);
  parts_.notify_all();
  help();
  for (std::uint32_t left = undone_.load(std::memory_order_acquire); left > 0;
       left = undone_.load(std::memory_order_acquire))
    await_change(undone_, left);
}

void Workers::work() {
  while (true) {
    const std::uint64_t seen = parts_.load(std::memory_order_acquire);
    if (stops_) return;
    if ((seen & kParts) > 0) {
      help();
    } else {
      await_change(parts_, seen);
    }
  }
}

void Workers::help() {
  std::uint64_t seen = parts_.load(std::memory_order_acquire);
  while ((seen & kParts) > 0) {
    if (!parts_.compare_exchange_weak(seen, seen - 1, std::memory_order_acq_rel)) continue;
    const std::size_t begin = ((seen & kParts) - 1) * job_.grain;
    job_.call(job_.part, begin, std::min(begin + job_.grain, job_.count));
    if (undone_.fetch_sub(1, std::memory_order_acq_rel) == 1) undone_.notify_one();
    seen = parts_.load(std::memory_order_acquire);
  }
}

}  // namespace subworld
