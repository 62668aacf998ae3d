#pragma once

#include "io/options/command_line.hpp"

#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// How the display serves viewers.
struct LiveOptions {
  std::optional<int> port;            ///< none: it does not; 0: any free one
  std::string address = "127.0.0.1";  ///< to listen on
  std::string token;                  ///< that viewers must give; empty: none
  std::vector<std::string> origins;   ///< of other sites whose pages may read
};

/// Adds --live, --listen, --token and --origin. `what` is what the port does.
void add_live_options(CommandLine& line, LiveOptions& live, const std::string& what);
/// Throws `Error` (usage) where other machines could connect without a token.
void check_live_options(const LiveOptions& live);
/// The options as words of a command line, but for the token, which others on this machine would read there.
[[nodiscard]] std::vector<std::string> live_flags_of(const LiveOptions& live);

/// By this environment variable a program also gets the token.
inline constexpr const char* kTokenVariable = "SUBWORLD_TOKEN";
/// By this one a display gets the file that will have the verdict of its run; without it no launcher judges the run.
inline constexpr const char* kVerdictVariable = "SUBWORLD_VERDICT";
/// State of a display that waits for this file and has done all else.
inline constexpr const char* kAwaitsVerdict = "awaits verdict";

}  // namespace subworld
