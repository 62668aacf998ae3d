#pragma once

#include "coupling/select/selection.hpp"
#include "model/contact.hpp"
#include "model/messages/exchange.hpp"

#include <span>
#include <vector>

namespace subworld {

/// A contact as a border contact of the one of its bodies that is inside. Its impulses are turned to act on that one.
[[nodiscard]] BoundaryContact pair_of(const Contact& contact, BodyId inside);

/// Border contacts: those of the world's last step between a member and a body that is not in the sub-world
/// (paper 4.2).
void extract_border(std::span<const Contact> contacts, const Membership& membership, std::vector<BoundaryContact>& out);

/// Members with at least one border contact, ascending, each once.
void border_bodies(std::span<const BoundaryContact> border, std::vector<BodyId>& out);

}  // namespace subworld
