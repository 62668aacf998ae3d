#pragma once

#include "model/exchange.hpp"
#include "model/sorted.hpp"

#include <array>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

/// Frames and reports carry what has changed since a **base**: an older message of the same writer that its reader has
/// confirmed, so that the reader surely has it. The sender chooses the base by what the reader's own messages say,
/// never as the message sent last. Both sides remember their last kRememberedBases messages; where the sender does not
/// have the base any more, or none is confirmed, the message is complete. A reader without the base counts the message
/// as lost. Values are equal where all their bits are, so the reader restores what was sent bit by bit.
namespace subworld {

/// A longer delay, in cycles, than this leads to complete messages.
inline constexpr std::uint64_t kRememberedBases = 32;

struct MessageIdentity {
  UserId user{};
  std::uint64_t session = 0;
  std::uint64_t sender = 0;
  std::uint64_t stamp = 0;
  friend bool operator==(const MessageIdentity&, const MessageIdentity&) = default;
};
[[nodiscard]] inline MessageIdentity identity_of(const WorldFrame& m) noexcept {
  return {m.user, m.session, 0, m.stamp};
}
[[nodiscard]] inline MessageIdentity identity_of(const HapticReport& m) noexcept {
  return {m.user, m.session, m.sender, m.stamp};
}

/// The part of a message to which a later one may refer, as its reader has it.
struct Base {
  static constexpr std::uint64_t kNoStamp = ~std::uint64_t{0};
  bool usable = false;
  MessageIdentity identity{.stamp = kNoStamp};
  std::vector<BodyId> members, fixed;  ///< frames
  std::vector<std::uint32_t> islands;
  std::vector<StampedBody> states;  ///< of a report: the members
  std::vector<GhostModel> ghosts;   ///< frames
};

/// What one message is encoded or decoded with.
struct Delta {
  const Base* base = nullptr;  ///< null: the message is complete
  Base* next = nullptr;        ///< gets what the reader has after this message
};

inline const GhostModel kNoGhost{};
inline const GhostAxis kNoAxis{.normal = Vec3::Zero()};

[[nodiscard]] inline bool same_bits(double a, double b) noexcept { return std::memcmp(&a, &b, sizeof a) == 0; }
[[nodiscard]] inline bool same_bits(const Vec3& a, const Vec3& b) noexcept {
  return std::memcmp(a.data(), b.data(), 3 * sizeof(double)) == 0;
}
[[nodiscard]] inline bool same_bits(const Quat& a, const Quat& b) noexcept {
  return std::memcmp(a.coeffs().data(), b.coeffs().data(), 4 * sizeof(double)) == 0;
}

/// At rest in the origin if the base does not have it.
[[nodiscard]] inline BodyState state_of(const Base& base, BodyId id) noexcept {
  const auto at = find_sorted(base.states, id, &StampedBody::id);
  return at != base.states.end() ? at->state : BodyState{};
}
[[nodiscard]] inline const GhostModel& ghost_of(const Base& base, BodyId id) noexcept {
  const auto at = find_sorted(base.ghosts, id, &GhostModel::outside);
  return at != base.ghosts.end() ? *at : kNoGhost;
}

/// Whether the world overrules a member's state, so that it is not sent.
[[nodiscard]] inline bool is_overruled(const HapticReport& report, std::size_t member) noexcept {
  return report.omits_overruled && member < report.islands.size() && report.islands[member] == kOpenIsland;
}
/// Whether the motion of a ghost depends on the load in its model.
[[nodiscard]] inline bool reads_load(const GhostModel& ghost) noexcept {
  for (std::size_t i = 0; i < ghost.axis_count; ++i) {
    if (!ghost.axes[i].load_dependent_friction.isZero(0.0)) return true;
  }
  return false;
}
/// Notes the ghosts of a message. A load that was not sent is that of the base.
inline void keep_ghosts(const std::vector<GhostModel>& ghosts, const Base* base, Base& next) {
  next.ghosts = ghosts;
  if (base == nullptr) return;
  for (GhostModel& ghost : next.ghosts) {
    if (!reads_load(ghost)) ghost.load_n = ghost_of(*base, ghost.outside).load_n;
  }
}

/// The last messages of one direction of a topic. Their memory comes with the first one.
class Bases {
 public:
  /// Null if it is not there.
  [[nodiscard]] const Base* find(const MessageIdentity& identity) const noexcept;
  /// Where the next message is noted.
  [[nodiscard]] Base& next();
  /// Remembers what was noted. A stamp that is sent again with other contents is no base: which of them the reader has
  /// confirmed is not known.
  void keep() noexcept;

 private:
  std::vector<Base> kept_;  ///< by stamp
  Base next_;
};

}  // namespace subworld
