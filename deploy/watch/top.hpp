#pragma once

#include "model/messages/exchange.hpp"
#include "watch/programs.hpp"

#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// The options of `subworld top`.
struct TopRequest {
  std::optional<int> domain = {};  ///< none: all that programs of this machine use
  Network network = {};            ///< empty: as the programs of the domain
  bool once = false;
};

/// What is known of a domain at one instant.
struct DomainView {
  int domain = 0;
  std::optional<pid_t> launcher = {};         ///< of a run that has claimed the domain on this machine
  std::string fault = {};                     ///< why it cannot be joined; empty: it was
  std::vector<Status> statuses = {};          ///< the newest of each program
  std::vector<RunningProgram> programs = {};  ///< of this machine
};

/// The table of one domain: a heading, and a line for each program.
[[nodiscard]] std::string table_of(const DomainView& view);

/// Shows the domains in use, their programs and rates, each second until `q`, Ctrl-C or the end of the input; once
/// where the output is no terminal. It only reads the topic `status`. Throws `Error` (middleware) where the domain that
/// was named cannot be joined.
void show_top(const TopRequest& request);

}  // namespace subworld
