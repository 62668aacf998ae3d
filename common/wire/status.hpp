#pragma once

#include "model/error.hpp"
#include "model/messages/exchange.hpp"
#include "wire/bus.hpp"
#include "wire/last_messages.hpp"

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <semaphore>
#include <set>
#include <string>
#include <thread>
#include <utility>

namespace subworld {

/// A program counts as dead after this time without a status, s; one is sent every second.
inline constexpr double kStatusTimeout_s = 2.0;

/// Data of a loop that a status shows.
struct LoopState {
  double time_s = 0.0;
  std::uint64_t steps = 0;
  std::uint64_t missed = 0;        ///< missed deadlines
  std::uint64_t missed_by_os = 0;  ///< of `missed`
  double busy_s = 0.0;             ///< in all steps
  double force_n = 0.0;            ///< on the operator
  double real_time_factor = 1.0;
};

/// Publishes a program's `status` once a second, prints middleware events, and receives the other programs' statuses.
/// All of this runs in a thread of its own, so that a loop only stores and reads numbers.
class StatusBeacon {
 public:
  StatusBeacon(Bus& bus, ProgramKind program, std::uint32_t instance, std::string label);
  ~StatusBeacon();
  StatusBeacon(const StatusBeacon&) = delete;
  StatusBeacon& operator=(const StatusBeacon&) = delete;

  /// Sets the data of the next status. May be called at any rate, from the loop.
  void update(const LoopState& loop) noexcept;
  /// Sets the program's state and publishes at once.
  void enter(const std::string& state);
  /// Sets the progress of that state, 0 .. 1; published with the next status.
  void done(double ratio) noexcept { done_ratio_.store(ratio, std::memory_order_relaxed); }
  /// Sets whether the run is paused, for the next status.
  void pause(bool paused) noexcept { paused_.store(paused, std::memory_order_relaxed); }
  /// Publishes and prints a text at once, from the thread. May be called from the loop; does not block. `waits_for`
  /// sets that field of this status and of later ones.
  void note(std::string text, std::optional<std::string> waits_for = {});
  /// Middleware events since the loop began to run.
  [[nodiscard]] EventCounts events_of_run();
  /// Time since the last status of that program, in this process's own time, s. May be called at any rate, from the
  /// loop. Fast DDS reports the death of one of several programs only after the lease of its participant, 100 s.
  [[nodiscard]] double status_age_s(ProgramKind program, std::uint32_t instance) const noexcept;
  /// Whether a status of that program arrived within kStatusTimeout_s.
  [[nodiscard]] bool hears(ProgramKind program, std::uint32_t instance) const noexcept {
    return status_age_s(program, instance) < kStatusTimeout_s;
  }
  /// Whether a status of that program has ever arrived. Before, its age counts from the start of this program.
  [[nodiscard]] bool met(ProgramKind program, std::uint32_t instance) const noexcept;
  /// Whether that participant (`AnyReader::sender_participant`) has sent a status as a program of this kind, or one of
  /// another version. What another participant publishes in the place of such a program is of a foreign writer.
  [[nodiscard]] bool is_program(ProgramKind program, std::uint64_t participant) const;
  /// Prints and publishes why the program ends, and waits up to half a second until the others have it.
  void fail(const std::string& reason);
  /// Why that program has ended, by its own word; empty: it has sent none.
  [[nodiscard]] std::string last_words(ProgramKind program, std::uint32_t instance) const;
  /// Whether that program has ended by its own word: in order, or with last words.
  [[nodiscard]] bool has_ended(ProgramKind program, std::uint32_t instance) const;
  /// From now on the process of that program takes part that has just shown it by a message. What its predecessor said
  /// no longer counts: its end, or that it was replaced. `participant`: of the message (AnyReader::sender_participant);
  /// 0: not known.
  void begins(ProgramKind program, std::uint32_t instance, std::uint64_t participant);
  /// Whether another process of that program and instance has begun since. It runs perhaps, but not with this one.
  [[nodiscard]] bool is_replaced(ProgramKind program, std::uint32_t instance) const;
  /// Whether a process of that program and instance takes part in a run.
  [[nodiscard]] bool runs(ProgramKind program, std::uint32_t instance) const;
  /// Error text for a peer without a sign of life: what it said itself, or that it was stopped, or else "haptic_sim 0
  /// has died, is suspended".
  [[nodiscard]] std::string gone_text(ProgramKind program, std::uint32_t instance) const;
  /// Publishes and prints what came of the `Control` of that number. May be called from the loop; does not block.
  void answer(std::uint32_t order, OrderAnswer answer);

 private:
  struct Note {
    std::string text;
    std::optional<std::string> waits_for;
    std::optional<ControlReply> reply;
    Note* earlier;
  };

  /// `due`: once in about a second, with the rate of the loop.
  void publish(bool due);
  /// Receives the other programs' statuses; once a tick.
  void listen();
  void leave(Note* note);
  /// Notes since the last call, in order, joined by "; ". Sets `waits_for`, and publishes replies.
  std::string take_notes();
  /// Text for the middleware events. The absence of a peer is normal while programs start and end. It is reported only
  /// if the loop ran before it, and still runs one status later.
  std::string take_events();

  void hear_participant(std::uint64_t participant, const Status& status);
  /// Takes note of how another program ended.
  void hear_end(const Status& status, std::size_t slot, std::uint64_t participant);

  Bus* bus_;
  Writer<Status> writer_;
  Writer<ControlReply> replies_;
  Reader<Status> reader_;
  Status heard_;
  static constexpr std::size_t kPrograms = 4, kInstances = kMostUsers;
  std::atomic<bool> paused_{false};
  std::array<std::atomic<std::uint32_t>, kPrograms * kInstances> status_age_ticks_{};
  std::array<std::atomic<bool>, kPrograms * kInstances> met_{};
  mutable std::mutex words_mutex_;
  struct Heard {
    bool ran = false;
    bool another = false;       ///< one that was started later takes its place, and does not run yet
    bool stopped = false;       ///< it ended in order
    std::uint64_t process = 0;  ///< participant of begins(); 0: not known
    std::uint64_t newest = 0;   ///< participant of the newest status
    std::string last_words;     ///< empty: none
  };
  std::map<std::size_t, Heard> heard_of_;                        ///< by program and instance
  std::set<std::pair<std::uint64_t, std::size_t>> programs_of_;  ///< participant, kind of program
  bool other_version_ = false;                                   ///< a program of another version has been reported
  std::string label_;
  std::atomic<double> time_s_{0.0}, busy_s_{0.0}, force_n_{0.0}, real_time_factor_{1.0}, done_ratio_{0.0};
  std::atomic<std::uint64_t> steps_{0}, missed_{0}, missed_by_os_{0};
  std::atomic<Note*> newest_note_{nullptr};
  std::counting_semaphore<> wake_{0};
  std::atomic<bool> stop_{false};
  std::mutex mutex_;  ///< guards the following; the loop never locks it
  Status status_;
  bool failed_ = false;
  std::chrono::steady_clock::time_point counted_at_ = std::chrono::steady_clock::now();  ///< when the rate was computed
  std::uint64_t counted_steps_ = 0;  ///< steps at the last computation of the rate
  double counted_busy_s_ = 0.0;      ///< busy time at the last computation of the rate
  EventCounts at_start_;             ///< counts when the loop began to run
  std::string absences_;             ///< published if the loop still runs at the next status
  std::string unsent_;               ///< texts that no status has carried yet
  std::thread thread_;
};

/// Runs a program's body. An error that leaves it is printed and published first, before the middleware is taken apart,
/// where Fast DDS 2.9 may stop or crash; and its last messages are written to `last_messages` (empty: nowhere). Then it
/// is thrown on without its text.
template <class Body>
void with_last_words(StatusBeacon& status, const std::string& last_messages, Body&& body) {
  try {
    body();
  } catch (const Error& wrong) {
    status.fail(wrong.what());
    if (!last_messages.empty()) write_last_messages(last_messages);
    throw Error(wrong.code(), "");
  }
}

}  // namespace subworld
