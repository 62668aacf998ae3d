#pragma once

#include "wire/message_memory.hpp"

#include <string>
#include <vector>

namespace subworld {

/// Writes messages with their main figures as a table, the oldest first. No file where there are none. Returns what
/// went wrong; empty: nothing.
[[nodiscard]] std::string write_last_messages(std::vector<KeptMessage> messages, const std::string& path);
/// Those of this process, unless a launcher does that.
void write_last_messages(const std::string& path) noexcept;

}  // namespace subworld
