#pragma once

#include "model/exchange.hpp"
#include "wire/bus.hpp"

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <semaphore>
#include <string>
#include <thread>

namespace subworld {

/// A program without a status for so long is taken for dead; one comes every second.
inline constexpr double kSilent_s = 2.0;

/// What an answer to a `Control` of that number begins with, in the text of a `Status`.
[[nodiscard]] std::string answer_prefix(std::uint32_t order);

/// What a status shows of a loop.
struct LoopState {
  double time_s = 0.0;
  std::uint64_t steps = 0;
  std::uint64_t missed = 0;        ///< deadlines
  std::uint64_t missed_by_os = 0;  ///< of these
  double busy_s = 0.0;             ///< spent in all steps
  double force_n = 0.0;            ///< on the hand
  double real_time_factor = 1.0;
};

/// Publishes a program's `status` once a second, prints what the middleware reports in between and listens to the
/// others' statuses, all from a thread of its own, so that a loop only stores and reads numbers.
class StatusBeacon {
 public:
  StatusBeacon(Bus& bus, ProgramKind program, std::uint32_t instance, std::string label);
  ~StatusBeacon();
  StatusBeacon(const StatusBeacon&) = delete;
  StatusBeacon& operator=(const StatusBeacon&) = delete;

  /// What the next status shows; at any rate, from the loop.
  void update(const LoopState& loop) noexcept;
  /// Names what the program does now and publishes at once.
  void enter(const std::string& state);
  /// How much of it is done, 0 .. 1; published with the next status.
  void done(double ratio) noexcept { done_ratio_.store(ratio, std::memory_order_relaxed); }
  /// Says something: the thread publishes and prints it at once. From the loop, without waiting for anybody.
  void note(std::string text);
  /// What the middleware has reported since the loop began to run.
  [[nodiscard]] EventCounts events_of_run();
  /// For how long no status of that program has come, in this process's own time; at any rate, from the loop. Fast DDS
  /// does not tell that one of several programs has died before the lease of its participant, 10 s, is over.
  [[nodiscard]] double silent_s(ProgramKind program, std::uint32_t instance) const noexcept;
  /// Whether a status of that program came within the last second or two.
  [[nodiscard]] bool hears(ProgramKind program, std::uint32_t instance) const noexcept {
    return silent_s(program, instance) < kSilent_s;
  }
  /// Says what became of an order; likewise from the loop.
  void answer(std::uint32_t order, const std::string& text) { note(answer_prefix(order) + text); }

 private:
  struct Note {
    std::string text;
    Note* earlier;
  };

  void publish(double passed_s);
  /// Takes the others' statuses; once a tick.
  void listen();
  /// What was noted since the last call, in order, joined by "; ".
  std::string take_notes();
  /// What the middleware reported, in words. Suppression of a peer is worth no word while programs come and go: it is
  /// said only where the loop ran before and still runs a status later.
  std::string take_events();

  Bus* bus_;
  Writer<Status> writer_;
  Reader<Status> reader_;
  Status heard_;
  static constexpr std::size_t kPrograms = 4, kInstances = 64;
  std::array<std::atomic<std::uint32_t>, kPrograms * kInstances> silent_ticks_{};
  std::string label_;
  std::atomic<double> time_s_{0.0}, busy_s_{0.0}, force_n_{0.0}, real_time_factor_{1.0}, done_ratio_{0.0};
  std::atomic<std::uint64_t> steps_{0}, missed_{0}, missed_by_os_{0};
  std::atomic<Note*> newest_note_{nullptr};
  std::counting_semaphore<> wake_{0};
  std::atomic<bool> stop_{false};
  std::mutex mutex_;  ///< guards what follows; the loop never takes it
  Status status_;
  std::uint64_t counted_steps_ = 0;  ///< when the rate was last taken
  double counted_busy_s_ = 0.0;      ///< likewise
  EventCounts at_start_;             ///< when the loop began to run
  std::string suppression_;          ///< said if the loop still runs at the next status
  std::string unsent_;               ///< texts that no status has carried yet
  std::thread thread_;
};

}  // namespace subworld
