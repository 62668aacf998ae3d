#pragma once

#include "io/options/command_line.hpp"
#include "model/messages/exchange.hpp"
#include "model/settings/network.hpp"
#include "physics/shells/engine_exchange.hpp"
#include "run/run.hpp"
#include "session/collect.hpp"

#include <optional>
#include <string>

namespace subworld {

/// The options of `subworld run` or `subworld up`, as they are given.
struct RunWords {
  RunRequest request = {};
  std::string placement = "auto", restart = "never";

  /// The request that they make.
  [[nodiscard]] RunRequest complete() const;
};

// The options of `subworld`'s commands.
void add_run(CommandLine& line, RunWords& words);
void add_up(CommandLine& line, RunWords& words);
void add_collect(CommandLine& line, CollectRequest& request);

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

/// Sends one order, with a new number, to the programs on a domain and prints their answers. Throws `Error`: middleware
/// where there is no world within `wait_s`, failed where one refuses or does not answer within as long again.
void send_control(const Network& network, Control order, double wait_s);

}  // namespace subworld
