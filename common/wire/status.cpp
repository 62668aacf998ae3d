#include "wire/status.hpp"

#include <cstdio>
#include <utility>

namespace subworld {

StatusBeacon::StatusBeacon(Bus& bus, ProgramKind program, std::uint32_t instance, std::string label)
    : bus_(&bus), writer_(bus.writer<Status>()), label_(std::move(label)) {
  status_.program = program;
  status_.instance = instance;
}

void StatusBeacon::update(double now_s, double time_s, std::uint64_t steps, std::uint64_t missed_deadlines) noexcept {
  if (published_s_ == 0.0) published_s_ = now_s;
  const double passed_s = now_s - published_s_;
  if (passed_s < 1.0) return;
  status_.time_s = time_s;
  status_.rate_hz = static_cast<double>(steps - published_steps_) / passed_s;
  status_.steps = steps;
  status_.missed_deadlines = missed_deadlines;
  published_s_ = now_s;
  published_steps_ = steps;
  publish();
}

void StatusBeacon::enter(const std::string& state) {
  status_.state = state;
  publish();
}

void StatusBeacon::publish() noexcept {
  status_.events = bus_->events();
  status_.text = bus_->take_event_text();
  if (!status_.text.empty()) std::fprintf(stderr, "%s: %s\n", label_.c_str(), status_.text.c_str());
  writer_.write(status_);
}

}  // namespace subworld
