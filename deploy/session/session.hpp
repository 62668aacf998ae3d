#pragma once

#include "run/restart.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace subworld {

/// The options of `subworld up`.
struct SessionRequest {
  std::string session;       ///< file, or name in deploy/sessions
  std::string host;          ///< only this host's programs, here; empty: all
  bool namespaces = false;   ///< each host is a network namespace of this machine
  std::string link;          ///< between any two of them; empty: the session's
  std::uint64_t seed = 1;    ///< of the link's random draws, as of `subworld link`
  std::string dds;           ///< vendor or mixed; empty: the session's
  std::string out;           ///< folder for the results; empty: a new one
  std::string ssh = "ssh";   ///< program that starts commands on other hosts
  std::string command_line;  ///< as given
  bool explain = false;      ///< as in RunRequest
  Restart restart = Restart::never;
  bool strict = false;
};

/// Starts a session, watches it and stops it. Prints the verdict of the run, or, for one host, where its results are.
/// Returns the exit code. Throws `Error`: usage for the session, failed where a host cannot be reached.
int up(const SessionRequest& request);

/// The options of `subworld collect`.
struct CollectRequest {
  std::vector<std::string> folders;  ///< results of the programs of one run
  std::string scene;                 ///< its file, where it lies elsewhere than on the world's host; empty: the same
  std::string out;                   ///< empty: a new folder
  std::string command_line;
  bool explain = false;
  bool strict = false;
};

/// Makes one summary, with gates and a verdict, of results that programs wrote into several folders. Returns the exit
/// code. Throws `Error` (usage) where a part is missing, there twice, or of another run.
int collect(const CollectRequest& request);

}  // namespace subworld
