#pragma once

#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"
#include "watch/watchdog.hpp"
#include "wire/bus.hpp"

#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>

namespace subworld {

/// The newest status of each program, by program and instance.
using Statuses = std::map<std::pair<ProgramKind, std::uint32_t>, Status>;

/// "1 body" or "2 bodies".
[[nodiscard]] std::string bodies_text(std::size_t count);
/// The state of a run on one line: time, rate, force, misses and real-time factor; before the start, what it waits for.
[[nodiscard]] std::string progress_line(const Statuses& statuses, const Settings& settings, std::size_t bodies);

/// Shows a run: one line of progress, rewritten on a terminal and every five seconds elsewhere, and the messages of the
/// programs. It reads the topic `status`.
class Progress {
 public:
  /// `watchdog` receives each status of a program that takes part in the run.
  Progress(const Network& network, const Scene& scene, Watchdog& watchdog);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Call ten times a second.
  void operator()();
  /// Whether the world has reached the end of the run, by its own word.
  [[nodiscard]] bool run_is_over();
  /// Whether the display has done all but to show the verdict, for which it waits.
  [[nodiscard]] bool awaits_verdict();

 private:
  /// Clears the line of progress.
  void finish();
  void listen();
  /// Prints the message of a program; equal ones of several programs once.
  void say(const Status& status);
  void warn_of_overload(const Status& status);
  void watch(const Status& status);

  const Scene& scene_;
  Watchdog& watchdog_;
  std::unique_ptr<Bus> bus_;
  std::unique_ptr<Reader<Status>> reader_;
  Status status_;
  Statuses statuses_;
  bool over_ = false;
  std::set<std::string> said_;
  bool terminal_;
  bool shown_ = false;
  std::string line_;  ///< the one shown
  int calls_ = 0;
};

}  // namespace subworld
