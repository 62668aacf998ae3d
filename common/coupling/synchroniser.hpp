#pragma once

#include "coupling/blend.hpp"
#include "coupling/scheme.hpp"

#include <array>
#include <span>
#include <vector>

namespace subworld {

/// How far back either side keeps what it said, in cycles.
inline constexpr std::uint64_t kRememberedCycles = 16;

struct PairShift {
  BodyId id{};
  Shift world;  ///< of the world's copy
  Shift sub;    ///< of the sub-world's copy
};

/// Makes the two copies of every body one (paper 4.3). World and haptic process each feed it what both said of one
/// stamp and so compute the same blend without a second round trip. It also works late: a side that had not yet applied
/// an earlier blend when it wrote down its states says so (`echoed_stamp`, `confirmed_stamp`), and those states are
/// first corrected by the shifts that were still to come.
class Synchroniser {
 public:
  /// `peers` are the proxies of the other users: their world copies stand.
  Synchroniser(const Scheme& scheme, BodyId proxy, std::vector<BodyId> peers);

  /// Both of one stamp; stamps ascend. Bodies that only one side names are left out. The span lives until the next
  /// call.
  [[nodiscard]] std::span<const PairShift> synchronise(const WorldFrame& frame, const HapticReport& report);

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
  BodyId proxy_;
  std::vector<BodyId> peers_;
  std::array<Blend, kRememberedCycles> blends_;
};

}  // namespace subworld
