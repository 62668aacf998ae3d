#pragma once

#include "io/options.hpp"
#include "physics/engine_exchange.hpp"

#include <string>

namespace subworld {

/// What `subworld run` was asked for.
struct RunRequest {
  Options options;
  std::string command_line;     ///< as given
  std::string dds = "fastdds";  ///< or cyclonedds, or mixed: the vendors alternate
  int domain = -1;              ///< -1: the first that no other run holds
  bool gui = false;             ///< also a display process, which writes a picture
  bool place = true;            ///< in real time: a core of its own for the world, where there is room
  bool strict = false;          ///< a missed quality gate ends with 4
};

/// Starts, watches and stops the programs of one run and prints its verdict. Returns the exit code.
/// Throws `Error`: usage for the scene, middleware for a domain in use.
int run(const RunRequest& request);

/// Sends one order to the programs on a domain and prints their answers. `engine` belongs to the verb "engine".
/// Throws `Error`: middleware where no world hears it within `wait_s`, failed where one refuses or has not done it
/// within as long again.
void send_control(const Network& network, const std::string& verb, const EngineOrder& engine, double wait_s);

/// The folder of this program and of those that it starts.
[[nodiscard]] std::string program_folder();

/// Becomes the evaluation program `lab_NAME`. `arguments` end with a null, the first is the program's own name.
/// Throws `Error` (failed) where that program is missing.
void become_lab(const std::string& name, char** arguments);

/// Prints what a scene needs and what is left out, with the reasons. Throws `Error` (usage) for what `run` refuses.
void print_plan(const RunRequest& request);

}  // namespace subworld
