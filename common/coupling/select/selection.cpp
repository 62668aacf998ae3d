#include "coupling/select/selection.hpp"

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

void add_neighbours(const ContactGraph& graph, std::span<const Body> bodies, BodyId proxy, int depth,
                    std::vector<BodyId>& in_box) {
  const auto first = static_cast<std::ptrdiff_t>(in_box.size());
  std::size_t begin = in_box.size();
  in_box.push_back(proxy);
  for (int ring = 0; ring < depth; ++ring) {
    const std::size_t end = in_box.size();
    for (; begin < end; ++begin) {
      const BodyId id = in_box[begin];
      for (const Neighbour& n : graph.neighbours(id)) {
        const BodyId next = n.body;
        const bool found = std::find(in_box.begin() + first, in_box.end(), next) != in_box.end();
        if (!found && !bodies[index(next)].fixed()) in_box.push_back(next);
      }
    }
  }
  std::ranges::sort(in_box);
  const auto twice = std::ranges::unique(in_box);
  in_box.erase(twice.begin(), twice.end());
}

void select_fixed(std::span<const BodyId> near_members, std::span<const Contact> contacts, std::span<const Body> bodies,
                  Membership& out) {
  out.fixed.clear();
  for (const BodyId id : near_members) {
    if (bodies[index(id)].fixed()) out.fixed.push_back(id);
  }
  for (const Contact& c : contacts) {
    const auto touched = [&](BodyId fixed, BodyId other) {
      if (!bodies[index(fixed)].fixed() || !std::ranges::binary_search(out.members, other)) return;
      if (out.fixed.empty() || out.fixed.back() != fixed) out.fixed.push_back(fixed);
    };
    touched(c.a, c.b);
    touched(c.b, c.a);
  }
  std::ranges::sort(out.fixed);
  const auto twice = std::ranges::unique(out.fixed);
  out.fixed.erase(twice.begin(), twice.end());
}

void missing_from(std::span<const BodyId> from, std::span<const BodyId> other, std::vector<BodyId>& out) {
  out.clear();
  std::set_difference(from.begin(), from.end(), other.begin(), other.end(), std::back_inserter(out));
}

}  // namespace subworld
