#include "wire/status.hpp"

#include <sched.h>

#include <chrono>
#include <cstdio>
#include <utility>

namespace subworld {

std::string answer_prefix(std::uint32_t order) { return "control " + std::to_string(order) + ": "; }

StatusBeacon::StatusBeacon(Bus& bus, ProgramKind program, std::uint32_t instance, std::string label)
    : bus_(&bus), writer_(bus.writer<Status>()), label_(std::move(label)) {
  status_.program = program;
  status_.instance = instance;
  thread_ = std::thread([this] {
    const sched_param whenever{};
    sched_setscheduler(0, SCHED_OTHER, &whenever);
    std::unique_lock lock(mutex_);
    while (!stop_) {
      const bool woken = wake_.wait_for(lock, std::chrono::seconds(1), [this] { return stop_ || !note_.empty(); });
      if (!stop_ || !note_.empty()) publish(woken ? 0.0 : 1.0);
    }
  });
}

StatusBeacon::~StatusBeacon() {
  {
    const std::lock_guard lock(mutex_);
    if (!unsaid_.empty()) note_ += (note_.empty() ? "" : "; ") + unsaid_;
    stop_ = true;
  }
  wake_.notify_one();
  thread_.join();
}

void StatusBeacon::update(double time_s, std::uint64_t steps, std::uint64_t missed_deadlines) noexcept {
  time_s_.store(time_s, std::memory_order_relaxed);
  steps_.store(steps, std::memory_order_relaxed);
  missed_.store(missed_deadlines, std::memory_order_relaxed);
  if (!unsaid_.empty()) offer();
}

void StatusBeacon::enter(const std::string& state) {
  const std::lock_guard lock(mutex_);
  status_.state = state;
  publish(0.0);
}

void StatusBeacon::note(const std::string& text) {
  unsaid_ += (unsaid_.empty() ? "" : "; ") + text;
  offer();
}

void StatusBeacon::offer() {
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock.owns_lock()) return;
  note_ += (note_.empty() ? "" : "; ") + unsaid_;
  unsaid_.clear();
  wake_.notify_one();
}

void StatusBeacon::publish(double passed_s) {
  const std::uint64_t steps = steps_.load(std::memory_order_relaxed);
  if (passed_s > 0.0) status_.rate_hz = static_cast<double>(steps - counted_steps_) / passed_s;
  counted_steps_ = steps;
  status_.time_s = time_s_.load(std::memory_order_relaxed);
  status_.steps = steps;
  status_.missed_deadlines = missed_.load(std::memory_order_relaxed);
  status_.events = bus_->events();
  status_.text = bus_->take_event_text();
  if (!note_.empty()) status_.text += (status_.text.empty() ? "" : "; ") + note_;
  note_.clear();
  if (!status_.text.empty()) std::fprintf(stderr, "%s: %s\n", label_.c_str(), status_.text.c_str());
  writer_.write(status_);
}

}  // namespace subworld
