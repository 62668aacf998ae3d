#pragma once

#include "model/exchange.hpp"
#include "wire/bus.hpp"

#include <string>

namespace subworld {

/// Publishes a program's `status` once a second and prints what the middleware reports in between.
class StatusBeacon {
 public:
  StatusBeacon(Bus& bus, ProgramKind program, std::uint32_t instance, std::string label);

  /// Counts that the status shows; call at any rate with the program's clock (s). Publishes when a second has passed.
  void update(double now_s, double time_s, std::uint64_t steps, std::uint64_t missed_deadlines) noexcept;
  /// Names what the program does now and publishes at once.
  void enter(const std::string& state);

 private:
  void publish() noexcept;

  Bus* bus_;
  Writer<Status> writer_;
  std::string label_;
  Status status_;
  double published_s_ = 0.0;
  std::uint64_t published_steps_ = 0;
};

}  // namespace subworld
