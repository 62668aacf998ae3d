#pragma once

#include "coupling/schemes/scheme.hpp"
#include "coupling/sync/authority.hpp"
#include "coupling/sync/blend.hpp"

#include <span>
#include <vector>

namespace subworld {

/// How far back either side keeps what it said, in cycles.
[[nodiscard]] std::uint64_t remembered_cycles(const Settings& settings, const Scheme& scheme) noexcept;
/// How far ahead a change of the simulation ratio is planned, in cycles: so that no sub-world has begun the first cycle
/// that it concerns, and some of the frames that tell it may get lost.
[[nodiscard]] std::uint64_t planned_cycles(const Settings& settings, const Scheme& scheme) noexcept;

/// For how long neither side looks again, s: bodies that may touch a sub-world within that time are in its frame.
[[nodiscard]] inline double looked_ahead_s(const Settings& settings, const Scheme& scheme, double cycle_s) noexcept {
  return static_cast<double>(1 + planned_cycles(settings, scheme)) * cycle_s;
}

struct PairShift {
  BodyId id{};
  Shift world;  ///< of the world's copy
  Shift sub;    ///< of the sub-world's copy
};

/// Makes the two copies of every body one (paper 4.3), by the scheme's rule. World and haptic process each feed it what
/// both said of one stamp and so compute the same blend without a second round trip. It also works late: a side that
/// had not yet applied an earlier blend when it wrote down its states says so (`echoed_stamp`, `confirmed_stamp`), and
/// those states are first corrected by the shifts that were still to come.
class Synchroniser {
 public:
  /// For one user of the scene.
  Synchroniser(const Scheme& scheme, const Scene& scene, std::size_t user);

  /// Both of one stamp; stamps ascend. Bodies that only one side names are skipped. `lag_cycles`: age of the frame
  /// when the sub-world uses it. The span lives until the next call.
  [[nodiscard]] std::span<const PairShift> synchronise(const WorldFrame& frame, const HapticReport& report,
                                                       double lag_cycles);
  /// The two sides start anew with each other.
  void forget() noexcept {
    for (Blend& blend : blends_) blend = {};
    held_.clear();
  }

 private:
  struct Blend {
    std::uint64_t stamp = 0;
    std::vector<PairShift> pairs;
  };
  /// Adds the shifts of the blends after `applied` and before `stamp`.
  template <class Side>
  [[nodiscard]] BodyState caught_up(BodyId id, BodyState state, std::uint64_t applied, std::uint64_t stamp,
                                    Side side) const;

  const Scheme* scheme_;
  const Settings* settings_;
  Authority authority_;
  bool enters_late_;  ///< a sub-world uses a frame at a later time than that of its stamp
  bool tool_turns_;
  std::vector<Blend> blends_;  ///< by stamp
  std::vector<BodyId> held_;   ///< by both sides at the stamp before, ascending
};

}  // namespace subworld
