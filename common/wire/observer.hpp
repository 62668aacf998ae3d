#pragma once

#include "wire/bus.hpp"

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace subworld {

/// Reads the bytes of one topic for a viewer. Best effort, volatile and without a deadline in both modes: no writer
/// waits for it, and what it misses is no event of the run. It wakes no loop: its owner polls. Must not outlive its
/// bus. One thread at a time, which may be another than that of the bus.
class Observer {
 public:
  /// `topic` is a row of `kTopicTable`. Throws `Error` (middleware).
  Observer(const Bus& bus, std::size_t topic, const std::string& partition);
  Observer(Observer&&) noexcept;
  Observer& operator=(Observer&&) noexcept;
  ~Observer();

  /// Receives the oldest sample not yet taken, with its CDR header. False if there is none. Of each key it holds the
  /// newest `kNewestOfSeveral`.
  bool receive(std::vector<std::uint8_t>& cdr) noexcept;
  /// Number of matched writers.
  [[nodiscard]] int matched() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace subworld
