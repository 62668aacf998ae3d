#include "rt/cyclic.hpp"

#include <ctime>

namespace subworld {

Duration Cyclic::wait() noexcept {
  released_ = next_;
  next_ += slewed_;
  const std::int64_t ns = to_ns(released_ - spin_);
  const timespec until{static_cast<time_t>(ns / 1'000'000'000), static_cast<long>(ns % 1'000'000'000)};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr) != 0) {
  }
  TimePoint now = Clock::now();
  while (now < released_) now = Clock::now();
  return now - released_;
}

int Cyclic::skip(TimePoint now) noexcept {
  int skipped = 0;
  for (; now >= next_; ++skipped) {
    released_ = next_;
    next_ += slewed_;
  }
  return skipped;
}

}  // namespace subworld
