#pragma once

#include "coupling/selection.hpp"
#include "model/contact.hpp"
#include "model/exchange.hpp"

#include <span>
#include <vector>

namespace subworld {

/// Border contacts: those of the world's last step between a member and a body that is not in the sub-world
/// (paper 4.2).
void extract_border(std::span<const Contact> contacts, const Membership& membership, std::vector<BoundaryContact>& out);

/// Members with at least one border contact, ascending, each once.
void border_bodies(std::span<const BoundaryContact> border, std::vector<BodyId>& out);

}  // namespace subworld
