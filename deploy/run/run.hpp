#pragma once

#include "io/options/options.hpp"
#include "run/keeper.hpp"

#include <cstdint>
#include <string>

namespace subworld {

/// The options of `subworld run` and `subworld up`.
struct RunRequest {
  Options options;              ///< of a session: only the files to write; its file has the flags
  std::string command_line;     ///< as given
  std::string dds = "fastdds";  ///< or cyclonedds, or mixed: the vendors alternate. Empty: the session's
  int domain = -1;              ///< -1: the first that no other run holds
  bool gui = false;             ///< also start the display, which writes a picture
  bool page = false;            ///< also serve the page, and open it in a browser
  int ros_domain = -1;          ///< of ROS 2, to which the run is shown; -1: to none
  bool place = true;            ///< in real time: give the world a core of its own, where there is room
  bool explain = false;         ///< also print the result in plain words
  Restart restart = Restart::never;
  bool strict = false;  ///< a missed quality gate ends with exit code 4

  // Of a run on several hosts.
  std::string session;      ///< file, or name in deploy/sessions; empty: all programs run on this machine
  std::string host;         ///< start only this host's programs, here; empty: all
  bool namespaces = false;  ///< each host is a network namespace of this machine
  std::string link;         ///< between any two of them; empty: the session's
  std::uint64_t seed = 1;   ///< of the link's random draws, as of `subworld link`
  std::string ssh = "ssh";  ///< program that starts commands on other hosts
};

/// Starts, watches and stops the programs of one run and prints its verdict; with `host`, where the results are.
/// Returns the exit code. Throws `Error`: usage for scene and session, middleware for a domain in use, failed where a
/// host cannot be reached.
int run(const RunRequest& request);

}  // namespace subworld
