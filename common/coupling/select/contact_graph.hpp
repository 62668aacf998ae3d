#pragma once

#include "model/body.hpp"
#include "model/contact.hpp"
#include "model/disjoint_sets.hpp"

#include <cstdint>
#include <ranges>
#include <span>
#include <vector>

namespace subworld {

/// More of them cost an allocation until the buffer has grown.
inline constexpr std::size_t kUsualContacts = 8192;

/// A contact as one of its bodies sees it.
struct Neighbour {
  BodyId body{};             ///< the other one
  Vec3 outwards;             ///< the contact's normal, from this body towards the other
  double impulse_n_s = 0.0;  ///< normal
  std::uint32_t index = 0;   ///< of the contact
};

/// Which contacts a body has. Refers to the contacts it was made from.
class ContactGraph {
 public:
  ContactGraph() {
    entries_.reserve(kUsualContacts);
    touched_.reserve(kUsualContacts);
    listed_.reserve(kUsualContacts);
  }

  /// Ids of both bodies of every contact must be below `bodies`. Costs nothing for bodies without contacts.
  void build(std::span<const Contact> contacts, std::size_t bodies);

  /// One for each contact point.
  [[nodiscard]] auto neighbours(BodyId id) const noexcept {
    const auto entries = std::span(entries_).subspan(begin_[index(id)], count_[index(id)]);
    return entries | std::views::transform([this, id](std::uint32_t i) {
             const Contact& c = contacts_[i];
             return c.a == id ? Neighbour{c.b, -c.normal, c.normal_impulse, i}
                              : Neighbour{c.a, c.normal, c.normal_impulse, i};
           });
  }
  /// The contacts of any of these bodies, in the order of all contacts.
  void contacts_of(std::span<const BodyId> ids, std::vector<Contact>& out) const;
  [[nodiscard]] const Contact& contact(std::uint32_t i) const noexcept { return contacts_[i]; }

 private:
  std::span<const Contact> contacts_;
  std::vector<std::uint32_t> begin_, count_;  ///< by body: its place in entries_; zero for who has no contact
  std::vector<BodyId> touched_;               ///< bodies with contacts
  std::vector<std::uint32_t> entries_;
  mutable std::vector<std::uint32_t> listed_;
};

/// Islands of bodies that hang together by contacts.
class Islands {
 public:
  /// Each id is an island of its own. `ids` ascend.
  void begin(std::span<const BodyId> ids);
  /// Joins two bodies; one that is not among the ids makes the other's island open.
  void join(BodyId a, BodyId b) noexcept;
  void open(BodyId id) noexcept;
  /// Joins what `labels` of an earlier result, one for each of `ids`, say belongs together or is open.
  void join(std::span<const BodyId> ids, std::span<const std::uint32_t> labels) noexcept;

  [[nodiscard]] bool is_open(BodyId id) noexcept;
  /// For each of the ids: kOpenIsland, or a number that its island alone has.
  void labels(std::vector<std::uint32_t>& out);

 private:
  [[nodiscard]] std::size_t place(BodyId id) const noexcept;  ///< ids_.size() if it is not there

  std::vector<BodyId> ids_;
  DisjointSets sets_;       ///< of their indices
  std::vector<bool> open_;  ///< of roots
};

}  // namespace subworld
