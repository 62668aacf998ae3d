#pragma once

#include "coupling/messages/suppression.hpp"
#include "coupling/schemes/scheme.hpp"
#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"

#include <cstdint>
#include <optional>
#include <vector>

namespace subworld {

/// The messages between a sub-world and the world: which frame is in use, which reports were made, and which messages
/// do not come.
class WorldLink {
 public:
  WorldLink(const Scene& scene, const Scheme& scheme, std::size_t user);

  /// Whether the scene has all that a frame names.
  [[nodiscard]] bool knows(const WorldFrame& frame) const noexcept;
  /// A frame has been used.
  [[nodiscard]] bool framed() const noexcept { return frame_stamp_.has_value(); }
  /// How many frames are missing before this one; none where it may not be used, because it is not newer than the one
  /// before or names what the scene does not have.
  [[nodiscard]] std::optional<std::uint64_t> missing_before(const WorldFrame& frame) const noexcept;
  /// The frame is in use.
  void use(const WorldFrame& frame) noexcept;
  /// The sub-world starts anew from a frame.
  void restart(const WorldFrame& frame) noexcept;
  /// Whether no frame of this stamp will come; counts as used then.
  bool passes_frame(std::uint64_t stamp) noexcept;

  /// A new report, which lives for several cycles.
  [[nodiscard]] HapticReport& report(std::uint64_t stamp) noexcept;
  /// The report of a stamp; null: none since the start.
  [[nodiscard]] const HapticReport* report_of(std::uint64_t stamp) const noexcept;
  /// Whether the world waits for no report of this stamp, where the proxy is now at the end of a cycle.
  [[nodiscard]] bool suppresses(std::uint64_t stamp, const BodyState& proxy, double cycle_s) const;

 private:
  const Scene& scene_;
  const Scheme& scheme_;
  std::uint32_t user_;
  std::optional<std::uint64_t> frame_stamp_;  ///< of the newest used
  std::uint64_t started_stamp_ = 0;           ///< of the one from which the sub-world has started
  std::optional<std::uint64_t> known_stamp_;  ///< of the newest report that the world is known to have used
  bool reports_device_;
  bool sends_changes_;
  bool omits_overruled_;
  bool may_suppress_;
  SuppressedCycles suppression_;
  std::vector<HapticReport> reports_;  ///< by stamp
};

}  // namespace subworld
