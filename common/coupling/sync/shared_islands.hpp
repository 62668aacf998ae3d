#pragma once

#include "model/contact.hpp"
#include "model/disjoint_sets.hpp"
#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"

#include <cstdint>
#include <span>
#include <vector>

namespace subworld {

/// The authority over islands of several users. Where an island lies wholly inside each sub-world that holds any of its
/// bodies, in the world's copy and in all of theirs, the copies of the sub-worlds are right: they have the shorter step
/// and the motion of all devices. The world takes over their mean,
///   x <- x + w (sum of x_u / n - x),  w = max(0, 1 - t_p / T) min(1, k / 8).                              (16)
/// Each sub-world is corrected towards it as towards any state of the world.
///
/// | symbol | unit | is |
/// |---|---|---|
/// | x, x_u | | state of a body in the world, and in the sub-world of the n users u that hold it |
/// | t_p | s | greatest age of the device motion of another user in these sub-worlds |
/// | T | s | cycle of the world |
/// | k | | cycles for which the same sub-worlds have held all of the island |
///
/// A copy that has just entered is a cycle and the delay old; and one that must guess how another user's device moves
/// knows less than the world, which has the impulses of all users. Momentum is conserved: each copy has the full mass,
/// the weights of the copies add up to 1, and a correction changes a difference between copies only. A user's own proxy
/// is the user's.
struct MergedBody {
  BodyId id{};
  BodyState mean;       ///< of the copies
  double weight = 0.0;  ///< w of (16), above 0
};

class SharedIslands {
 public:
  explicit SharedIslands(const Scene& scene);

  /// `contacts` of the world's cycle that ends at the reports' stamp; `reports` of all users, null where one is
  /// missing: nothing is shared then. The merged bodies, ascending, until the next call.
  std::span<const MergedBody> merge(std::span<const Contact> contacts, std::span<const HapticReport* const> reports,
                                    double cycle_s);

 private:
  struct Copies {
    std::uint64_t holders = 0;  ///< bit u: user u
    std::uint32_t place = 0;    ///< in held_
    std::uint64_t before = 0;   ///< holders in the cycle before
    std::uint32_t cycles = 0;   ///< with the same holders
  };
  struct Island {
    std::uint64_t holders = 0;
    std::uint32_t cycles = 0;  ///< k
    double age_s = 0.0;        ///< t_p
    bool open = false;         ///< reaches out of a sub-world that holds a part of it
  };
  [[nodiscard]] bool held(BodyId id) const noexcept { return copies_[index(id)].holders != 0; }
  void hold(std::span<const HapticReport* const> reports);
  [[nodiscard]] Island& island(BodyId id) noexcept { return islands_[sets_.root(copies_[index(id)].place)]; }
  void join(BodyId a, BodyId b) noexcept;
  void join(const HapticReport& report) noexcept;
  [[nodiscard]] BodyState mean(BodyId id, std::span<const HapticReport* const> reports) const;

  const Scene& scene_;
  std::vector<std::size_t> owners_;  ///< by body: the user whose proxy it is; else the number of users
  std::vector<Copies> copies_;       ///< by body
  std::vector<BodyId> held_, before_;
  DisjointSets sets_;            ///< of the places in held_
  std::vector<Island> islands_;  ///< by root
  std::vector<MergedBody> merged_;
};

}  // namespace subworld
