#pragma once

#include "wire/backend.hpp"
#include "wire/fastdds/vendor.hpp"

#include <set>
#include <string>

namespace subworld::wire::fast {

/// The user's settings file, with the interface, the peers and the ports of this participant. `route_text`: what they
/// are, for messages. `own_numbers`: of the other participants of this process, in any domain. Throws `Error`
/// (middleware).
[[nodiscard]] dds::DomainParticipantQos participant_qos(dds::DomainParticipantFactory& factory, const Opening& opening,
                                                        std::string& route_text, const std::set<int>& own_numbers = {});

}  // namespace subworld::wire::fast
