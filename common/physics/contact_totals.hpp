#pragma once

#include "model/contact.hpp"

#include <cstdint>
#include <span>
#include <vector>

namespace subworld {

/// Adds up the contacts of several sub-steps. A point that occurs in several of them is identified by its place.
class ContactTotals {
 public:
  ContactTotals();

  void clear() noexcept;
  /// `reach_m`: largest distance of a point from its place in the previous sub-step, m. Call with ascending `substep`.
  void add(const Contact& contact, int substep, double reach_m);
  /// Takes the contacts of a step without sub-steps and orders them by bodies.
  void take(std::span<const Contact> contacts);
  /// Ends the step: contacts ordered by bodies, latest place and distance, sum of impulses.
  void merge();
  [[nodiscard]] std::span<const Contact> contacts() const noexcept { return contacts_; }

 private:
  struct Collected {
    Contact contact;
    int substep;
    double reach_m;
  };
  /// Consecutive contacts of one pair of bodies.
  struct Run {
    std::uint64_t bodies;      ///< both ids; the order is that of the pairs
    std::uint32_t begin, end;  ///< range of indices
  };
  void note(const Contact& contact, std::uint32_t place);
  /// By bodies; stable.
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
  std::vector<int> last_seen_;  ///< sub-step of contacts_[i]
};

}  // namespace subworld
