#pragma once

#include "wire/backend.hpp"
#include "wire/bus.hpp"

#include <string>

namespace subworld::wire {

[[nodiscard]] EventKind kind_of(Event event) noexcept;

/// Meaning of an event for a user, and the cure; empty if no action is needed.
[[nodiscard]] std::string explain(Event event, std::string_view side, std::string_view topic, std::string_view detail);

}  // namespace subworld::wire
