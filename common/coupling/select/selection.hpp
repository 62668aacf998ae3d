#pragma once

#include "coupling/select/contact_graph.hpp"
#include "model/body.hpp"

#include <span>
#include <vector>

namespace subworld {

/// Bodies of one user's sub-world; both lists ascend.
struct Membership {
  std::vector<BodyId> members;  ///< movable
  std::vector<BodyId> fixed;

  [[nodiscard]] bool holds(BodyId id) const noexcept;
};

/// Axis-aligned cube of half side `half_m` around the proxy (paper 4.1).
[[nodiscard]] Box selection_box(const Vec3& proxy_position, double half_m) noexcept;

/// Splits what meets the box into `out.members`; the proxy always belongs. `in_box` ascends.
void select_members(std::span<const BodyId> in_box, std::span<const Body> bodies, BodyId proxy, Membership& out);

/// Adds the movable bodies that are attached to the proxy by at most `depth` contacts to `in_box`, which stays
/// ascending.
void add_neighbours(const ContactGraph& graph, std::span<const Body> bodies, BodyId proxy, int depth,
                    std::vector<BodyId>& in_box);

/// Fixed bodies are wanted wherever a member can touch one: `near_members` are the bodies that meet the members'
/// bounds. What a member touches already belongs, whatever the bounds say.
void select_fixed(std::span<const BodyId> near_members, std::span<const Contact> contacts, std::span<const Body> bodies,
                  Membership& out);

/// Ids of `from` that `other` lacks; both ascend.
void missing_from(std::span<const BodyId> from, std::span<const BodyId> other, std::vector<BodyId>& out);

}  // namespace subworld
