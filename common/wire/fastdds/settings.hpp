#pragma once

#include "wire/backend.hpp"
#include "wire/fastdds/vendor.hpp"

#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>

#include <string>

namespace subworld::wire::fast {

/// The user's settings file, with the interface, the peers and the ports of this participant. `route_text`: what they
/// are, for messages. Throws `Error` (middleware).
[[nodiscard]] dds::DomainParticipantQos participant_qos(dds::DomainParticipantFactory& factory, const Opening& opening,
                                                        std::string& route_text);

}  // namespace subworld::wire::fast
