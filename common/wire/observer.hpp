#pragma once

#include "wire/bus.hpp"

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace subworld {

/// Writes the bytes of one topic in the place of a program. Must not outlive its bus. One thread.
class ByteWriter {
 public:
  virtual ~ByteWriter() = default;
  /// Bytes with their CDR header. Does not wait. False if the middleware refused them.
  virtual bool write(std::span<const std::uint8_t> cdr) noexcept = 0;
  [[nodiscard]] virtual int matched() const noexcept = 0;
};

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

  /// The writer of a topic to those who would observe it. It offers late joiners the newest samples, in both modes.
  /// Throws `Error` (middleware).
  [[nodiscard]] static std::unique_ptr<ByteWriter> counterpart(const Bus& bus, std::size_t topic,
                                                               const std::string& partition);

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
