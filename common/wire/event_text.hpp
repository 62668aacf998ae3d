#pragma once

#include "wire/backend.hpp"
#include "wire/bus.hpp"

#include <string>

namespace subworld::wire {

[[nodiscard]] EventKind kind_of(Event event) noexcept;

/// What an event means for a user and what to do about it; empty where there is nothing to do.
[[nodiscard]] std::string explain(Event event, std::string_view side, std::string_view topic, std::string_view detail);

}  // namespace subworld::wire
