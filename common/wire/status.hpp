#pragma once

#include "model/exchange.hpp"
#include "wire/bus.hpp"

#include <atomic>
#include <cstdint>
#include <mutex>
#include <semaphore>
#include <string>
#include <thread>

namespace subworld {

/// What an answer to a `Control` of that number begins with, in the text of a `Status`.
[[nodiscard]] std::string answer_prefix(std::uint32_t order);

/// Publishes a program's `status` once a second and prints what the middleware reports in between, from a thread of its
/// own, so that a loop only stores numbers.
class StatusBeacon {
 public:
  StatusBeacon(Bus& bus, ProgramKind program, std::uint32_t instance, std::string label);
  ~StatusBeacon();
  StatusBeacon(const StatusBeacon&) = delete;
  StatusBeacon& operator=(const StatusBeacon&) = delete;

  /// What the next status shows; at any rate, from the loop.
  void update(double time_s, std::uint64_t steps, std::uint64_t missed_deadlines) noexcept;
  /// Names what the program does now and publishes at once.
  void enter(const std::string& state);
  /// Says something: the thread publishes and prints it at once. From the loop, without waiting for anybody.
  void note(std::string text);
  /// Says what became of an order; likewise from the loop.
  void answer(std::uint32_t order, const std::string& text) { note(answer_prefix(order) + text); }

 private:
  struct Note {
    std::string text;
    Note* earlier;
  };

  void publish(double passed_s);
  /// What was noted since the last call, in order, joined by "; ".
  std::string take_notes();

  Bus* bus_;
  Writer<Status> writer_;
  std::string label_;
  std::atomic<double> time_s_{0.0};
  std::atomic<std::uint64_t> steps_{0};
  std::atomic<std::uint64_t> missed_{0};
  std::atomic<Note*> newest_note_{nullptr};
  std::counting_semaphore<> wake_{0};
  std::atomic<bool> stop_{false};
  std::mutex mutex_;  ///< guards what follows; the loop never takes it
  Status status_;
  std::uint64_t counted_steps_ = 0;  ///< when the rate was last taken
  std::string unsent_;               ///< texts that no status has carried yet
  std::thread thread_;
};

}  // namespace subworld
