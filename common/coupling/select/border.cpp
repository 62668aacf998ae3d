#include "coupling/select/border.hpp"

#include <algorithm>

namespace subworld {

BoundaryContact pair_of(const Contact& contact, BodyId inside) {
  const bool a_inside = contact.a == inside;
  const double sign = a_inside ? 1.0 : -1.0;
  return {.inside = inside,
          .outside = a_inside ? contact.b : contact.a,
          .point = contact.point,
          .normal = sign * contact.normal,
          .distance = contact.distance,
          .normal_impulse = contact.normal_impulse,
          .tangential_impulse = sign * contact.tangential_impulse};
}

void extract_border(std::span<const Contact> contacts, const Membership& membership,
                    std::vector<BoundaryContact>& out) {
  out.clear();
  const auto movable_member = [&](BodyId id) {
    return std::binary_search(membership.members.begin(), membership.members.end(), id);
  };
  for (const Contact& c : contacts) {
    const bool a_inside = movable_member(c.a);
    const bool b_inside = movable_member(c.b);
    if (a_inside == b_inside || membership.holds(a_inside ? c.b : c.a)) continue;
    out.push_back(pair_of(c, a_inside ? c.a : c.b));
  }
}

void border_bodies(std::span<const BoundaryContact> border, std::vector<BodyId>& out) {
  out.clear();
  for (const BoundaryContact& pair : border) out.push_back(pair.inside);
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
}

}  // namespace subworld
