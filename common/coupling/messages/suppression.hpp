#pragma once

#include "model/messages/exchange.hpp"

#include <span>

namespace subworld {

/// Longest suppression, in cycles.
inline constexpr std::uint64_t kMostSuppressedCycles = 32;

/// Cycles without messages. While a sub-world holds nothing but its proxy, and nothing can come near that, neither side
/// has anything to tell. A frame says until which stamp, and in which place of the proxy. The sub-world reports then,
/// or at the end of the first cycle after which its proxy may leave that place; frames go on at the stamp of that
/// report. Both sides count by this class, so each knows which messages do not come. A report that the sub-world had
/// sent before it saw the frame is none of these.
class SuppressedCycles {
 public:
  explicit SuppressedCycles(int lead_cycles) noexcept : lead_(static_cast<std::uint64_t>(lead_cycles)) {}

  /// A frame that both sides use.
  void begin(const WorldFrame& frame) noexcept;
  /// The report of this stamp, which ends a suppression if it comes after the frame was seen.
  void end(std::uint64_t stamp) noexcept;
  /// The sub-world starts anew.
  void forget() noexcept { from_ = until_ = 0; }

  /// Whether the report of this stamp need not come, if the proxy stays in place().
  [[nodiscard]] bool may_lack_report(std::uint64_t stamp) const noexcept {
    return stamp > from_ + lead_ && stamp < until_;
  }
  /// Whether it will not come: a later one has ended the suppression.
  [[nodiscard]] bool lacks_report(std::uint64_t stamp) const noexcept { return ended_ && may_lack_report(stamp); }
  [[nodiscard]] bool lacks_frame(std::uint64_t stamp) const noexcept { return stamp > from_ && stamp < until_; }
  [[nodiscard]] const Box& place() const noexcept { return place_; }

 private:
  std::uint64_t lead_;
  std::uint64_t from_ = 0;   ///< the stamp of the frame that began it
  std::uint64_t until_ = 0;  ///< the stamp of the report that ends it
  bool ended_ = false;
  Box place_;
};

/// A part of `around` that holds `inner` and meets no obstacle, as large as single cuts leave it; where an obstacle
/// meets `inner`, the result does not hold it.
[[nodiscard]] Box free_place(const Box& around, const Box& inner, std::span<const Box> obstacles) noexcept;

}  // namespace subworld
