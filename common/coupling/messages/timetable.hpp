#pragma once

#include "model/messages/exchange.hpp"

#include <cstdint>
#include <vector>

namespace subworld {

/// When cycles begin, in haptic steps since t = 0, while the simulation ratio changes. Cycle j begins at stamp j and
/// has as many haptic steps as the newest change at or before j says. The world plans changes ahead and every frame
/// tells the newest one, so that both sides count alike.
class Timetable {
 public:
  /// `remembered_cycles`: how far back stamps are asked for.
  Timetable(int ratio, std::uint64_t remembered_cycles);

  /// Begins anew at a stamp that is `step` haptic steps after t = 0.
  void restart(std::uint64_t stamp, std::uint64_t step, int ratio);
  /// Plans a change after the newest one; any other does nothing.
  void plan(const RatioChange& change);
  [[nodiscard]] RatioChange newest() const noexcept;

  /// Haptic steps from t = 0 to a stamp.
  [[nodiscard]] std::uint64_t start(std::uint64_t stamp) const noexcept;
  /// Haptic steps in the cycle that begins at a stamp.
  [[nodiscard]] int ratio(std::uint64_t stamp) const noexcept { return at(stamp).ratio; }

 private:
  struct Entry {
    std::uint64_t stamp = 0;
    std::uint64_t start = 0;
    int ratio = 1;
  };
  [[nodiscard]] const Entry& at(std::uint64_t stamp) const noexcept;

  std::uint64_t remembered_;
  std::vector<Entry> entries_;  ///< by stamp; the first one counts for all before
};

}  // namespace subworld
