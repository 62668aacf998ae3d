#pragma once

#include "io/results.hpp"

#include <string>

/// Access to a summary that may lack any key: it may be of a failed run, or of another version.
namespace subworld {

/// The value at a path as "world/step_s/p99" or "gates/0/name"; null where there is none.
[[nodiscard]] const Json& value_at(const Json& json, const std::string& path);
/// Not a number where there is none.
[[nodiscard]] double number_at(const Json& json, const std::string& path);
/// Words as they are, others as JSON; empty where there is none.
[[nodiscard]] std::string text_at(const Json& json, const std::string& path);

}  // namespace subworld
