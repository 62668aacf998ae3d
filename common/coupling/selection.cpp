#include "coupling/selection.hpp"

#include <algorithm>
#include <iterator>

namespace subworld {

bool Membership::holds(BodyId id) const noexcept {
  return std::binary_search(members.begin(), members.end(), id) || std::binary_search(fixed.begin(), fixed.end(), id);
}

Box selection_box(const Vec3& proxy_position, double half_m) noexcept {
  return {proxy_position - Vec3::Constant(half_m), proxy_position + Vec3::Constant(half_m)};
}

void select_members(std::span<const BodyId> in_box, std::span<const Body> bodies, BodyId proxy, Membership& out) {
  out.members.clear();
  for (const BodyId id : in_box) {
    if (!bodies[index(id)].fixed()) out.members.push_back(id);
  }
  const auto at = std::lower_bound(out.members.begin(), out.members.end(), proxy);
  if (at == out.members.end() || *at != proxy) out.members.insert(at, proxy);
}

void select_fixed(std::span<const BodyId> near_members, std::span<const Body> bodies, Membership& out) {
  out.fixed.clear();
  for (const BodyId id : near_members) {
    if (bodies[index(id)].fixed()) out.fixed.push_back(id);
  }
}

void missing_from(std::span<const BodyId> from, std::span<const BodyId> other, std::vector<BodyId>& out) {
  out.clear();
  std::set_difference(from.begin(), from.end(), other.begin(), other.end(), std::back_inserter(out));
}

}  // namespace subworld
