#pragma once

#include "io/options.hpp"
#include "model/exchange.hpp"
#include "physics/engine_exchange.hpp"
#include "run/supervise.hpp"

#include <string>
#include <vector>

namespace subworld {

/// The options of `subworld run`.
struct RunRequest {
  Options options;
  std::string command_line;     ///< as given
  std::string dds = "fastdds";  ///< or cyclonedds, or mixed: the vendors alternate
  int domain = -1;              ///< -1: the first that no other run holds
  bool gui = false;             ///< also start the display, which writes a picture
  bool page = false;            ///< also serve the page, and open it in a browser
  bool place = true;            ///< in real time: give the world a core of its own, where there is room
  bool explain = false;         ///< also print the result in plain words
  Restart restart = Restart::never;
  bool strict = false;  ///< a missed quality gate ends with exit code 4
};

/// Starts, watches and stops the programs of one run and prints its verdict. Returns the exit code.
/// Throws `Error`: usage for the scene, middleware for a domain in use.
int run(const RunRequest& request);

/// Sends one order, with a new number, to the programs on a domain and prints their answers. Throws `Error`: middleware
/// where there is no world within `wait_s`, failed where one refuses or does not answer within as long again.
void send_control(const Network& network, Control order, double wait_s);

/// The vendor of the program at a position among those of a run; with "mixed" they alternate.
[[nodiscard]] std::string vendor_of(const std::string& dds, int position);

/// The flags of a world that is started again: it resumes from the checkpoints in its folder, or from `otherwise` where
/// it has written none (empty: it begins at t = 0).
[[nodiscard]] std::vector<std::string> resumed(std::vector<std::string> flags, const std::string& folder,
                                               const std::string& otherwise = {});

/// Prints which optimisations are on or off for a scene, with the reasons. Throws `Error` (usage) where `run` would.
void print_plan(const RunRequest& request);

}  // namespace subworld
