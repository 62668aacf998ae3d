#pragma once

#include "io/command_line.hpp"
#include "run/launch.hpp"
#include "session/session.hpp"

#include <optional>
#include <string>

namespace subworld {

// The options of `subworld`'s commands. `placement` and `restart` are words of --placement and --restart.
void add_run(CommandLine& line, RunRequest& request, std::string& placement, std::string& restart);
void add_up(CommandLine& line, SessionRequest& request, std::string& restart);
void add_collect(CommandLine& line, CollectRequest& request);

/// What a word of --restart stands for.
[[nodiscard]] Restart restart_of(const std::string& word);

/// `subworld control`: an order, and what it acts on.
struct ControlRequest {
  Network network;
  std::string verb;
  EngineOrder engine;
  std::optional<int> user;
  std::optional<double> time_s;
  std::optional<double> speed;
  std::string ratio;
  bool haptic = false;
  double wait_s = 5.0;
};

void add_control(CommandLine& line, ControlRequest& request);
/// Sends the order. Throws `Error` (usage) where it lacks something, or has something that it does not take.
void control(ControlRequest& request);

}  // namespace subworld
