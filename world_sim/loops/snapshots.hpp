#pragma once

#include "rt/newest.hpp"
#include "wire/bus.hpp"
#include "wire/message_memory.hpp"
#include "world_sim/world.hpp"

#include <condition_variable>
#include <mutex>
#include <thread>

namespace subworld {

/// The display's decimated view of the world: what moved, and everything once a second.
class Snapshots {
 public:
  explicit Snapshots(Writer<WorldSnapshot>& writer) : writer_(writer) {}

  /// Whether there is a reader, or a recorder.
  [[nodiscard]] bool used() const { return writer_.matched() > 0 || is_recording(); }
  /// Whether the next one is due.
  [[nodiscard]] bool wanted(double time_s) const { return used() && time_s >= next_s_; }
  /// Whether the world has stepped since the last one: after a single step of a paused world too.
  [[nodiscard]] bool outdated(double time_s) const {
    return used() && (snapshot_.sequence == 0 || time_s > snapshot_.stamp_s);
  }
  void publish(const WorldView& view, bool complete);

 private:
  Writer<WorldSnapshot>& writer_;
  WorldSnapshot snapshot_;
  std::vector<BodyState> shown_;
  double next_s_ = 0.0;
  double next_complete_s_ = 0.0;
};

/// Snapshots from a thread of its own, which looks at the world while it steps: the loop only writes down where the
/// bodies are (paper 3.1).
class BackgroundSnapshots {
 public:
  BackgroundSnapshots(Writer<WorldSnapshot>& writer, const World& world);
  ~BackgroundSnapshots();
  BackgroundSnapshots(const BackgroundSnapshots&) = delete;
  BackgroundSnapshots& operator=(const BackgroundSnapshots&) = delete;

  /// After each step, from the loop. Does not wait.
  void renew(const World& world, double real_time_factor);
  /// Publishes how it ended, whole.
  void finish();

 private:
  void work();

  Snapshots snapshots_;
  Newest<WorldView> newest_;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace subworld
