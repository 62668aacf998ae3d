#pragma once

#include "wire/backend.hpp"
#include "wire/cyclonedds/vendor.hpp"

#include <string>

namespace subworld::wire::cyclone {

/// Asks for DDS Security in a participant's quality of service.
void use_keys(dds_qos_t* qos, const Keys& keys);

/// The configuration of the domain: defaults, the user's settings file, interface and peers. `route_text`: the latter
/// two, for messages. Throws `Error` (middleware).
[[nodiscard]] std::string make_settings(const Opening& opening, std::string& route_text);

}  // namespace subworld::wire::cyclone
