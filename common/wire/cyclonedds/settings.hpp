#pragma once

#include "wire/backend.hpp"

#include <string>

namespace subworld::wire::cyclone {

/// The configuration of the domain: defaults, the user's settings file, interface and peers. `route_text`: the latter
/// two, for messages. Throws `Error` (middleware).
[[nodiscard]] std::string make_settings(const Opening& opening, std::string& route_text);

}  // namespace subworld::wire::cyclone
