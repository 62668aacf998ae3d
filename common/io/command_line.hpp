#pragma once

#include <optional>

namespace CLI {
class App;
}

namespace subworld {

/// Reads a command line. The exit code where only help was wanted. Throws `Error` (usage) for a wrong one; an unknown
/// option is named with the nearest known one.
[[nodiscard]] std::optional<int> parse_arguments(CLI::App& app, int argc, const char* const* argv);

}  // namespace subworld
