#pragma once

#include "model/exchange.hpp"
#include "model/scene.hpp"
#include "wire/bus.hpp"

#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>

namespace subworld {

/// The newest status of each program, by program and instance.
using Statuses = std::map<std::pair<ProgramKind, std::uint32_t>, Status>;

/// How far a run is, on one line: while it runs time, rate, force, misses and the clock, before that what it waits for.
[[nodiscard]] std::string progress_line(const Statuses& statuses, const Settings& settings, std::size_t bodies);

/// Shows a run on the terminal: one line that says how far it is, rewritten on a terminal and every five seconds
/// elsewhere, and what the programs have to say. It listens to the topic `status`.
class Progress {
 public:
  Progress(const Network& network, const Scene& scene);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Ten times a second.
  void operator()();
  /// Takes the line off the terminal.
  void finish();

 private:
  void listen();
  /// Prints what a program says; the same words of several programs once.
  void say(const Status& status);
  void warn_of_overload(const Status& status);

  const Scene& scene_;
  std::unique_ptr<Bus> bus_;
  std::unique_ptr<Reader<Status>> reader_;
  Status status_;
  Statuses statuses_;
  std::set<std::string> said_;
  bool terminal_;
  bool shown_ = false;
  std::string line_;  ///< the one shown
  int calls_ = 0;
};

}  // namespace subworld
