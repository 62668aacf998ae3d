#pragma once

#include "model/error.hpp"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <optional>

namespace subworld {

/// Reads the command line of an evaluation program or a benchmark. The exit code where only help was wanted. Throws
/// `Error` (usage) for a wrong one.
inline std::optional<int> parse_arguments(CLI::App& app, int argc, const char* const* argv) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& done) {
    return app.exit(done);
  } catch (const CLI::ParseError& wrong) {
    throw Error(ExitCode::usage, fmt::format("{}; see {} --help", wrong.what(), app.get_name()));
  }
  return std::nullopt;
}

}  // namespace subworld
