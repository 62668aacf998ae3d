#pragma once

#include "model/contact.hpp"

#include <cstdint>
#include <span>
#include <vector>

namespace subworld {

/// Adds up the contacts of several sub-steps. A point that more than one of them saw is found again by its place.
class ContactTotals {
 public:
  ContactTotals();

  void clear() noexcept;
  /// `reach_m`: how far a point may lie from where the sub-step before saw it. Call with ascending `substep`.
  void add(const Contact& contact, int substep, double reach_m);
  /// The contacts of a step without sub-steps, by bodies.
  void take(std::span<const Contact> contacts);
  /// Closes the step: contacts by bodies, place and velocity as last seen, impulses summed.
  void merge();
  [[nodiscard]] std::span<const Contact> contacts() const noexcept { return contacts_; }

 private:
  struct Collected {
    Contact contact;
    int substep;
    double reach_m;
  };
  /// Contacts of one pair of bodies that were added one after the other.
  struct Run {
    std::uint64_t bodies;      ///< both ids; orders as the pair does
    std::uint32_t begin, end;  ///< places
  };
  void note(const Contact& contact, std::uint32_t place);
  /// By bodies; runs of one pair stay in their order.
  void sort_runs();
  template <class Id>
  void sort_by(std::uint32_t last, const Id& id);
  static std::uint32_t first(const Run& run) noexcept { return static_cast<std::uint32_t>(run.bodies >> 32); }
  static std::uint32_t second(const Run& run) noexcept { return static_cast<std::uint32_t>(run.bodies); }
  void add_up(const Collected& next, std::size_t pair_begin);
  [[nodiscard]] std::size_t find(const Collected& wanted, std::size_t begin) const;

  std::vector<Collected> collected_;
  std::vector<Run> runs_, sorted_;
  std::vector<std::uint32_t> places_;
  std::vector<Contact> contacts_;
  std::vector<int> last_seen_;  ///< sub-step, of contacts_[i]
};

}  // namespace subworld
