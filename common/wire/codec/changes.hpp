#pragma once

#include "model/messages/exchange.hpp"
#include "model/vectors.hpp"

#include <cstdint>
#include <type_traits>
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

/// What one message is packed or unpacked with.
struct Delta {
  const Base* base = nullptr;  ///< null: the message is complete
  Base* next = nullptr;        ///< gets what the reader has after this message
};

/// What travels in place of the lists of a frame or a report: structs of the IDL, which describes them.
template <class T>
struct ListChanges {
  bool as_in_base = false;
  std::vector<T> values;
};
struct StateChanges {
  ListChanges<BodyId> bodies;
  std::vector<std::uint8_t> changed;
  std::vector<Vec3> vectors;
  std::vector<Quat> orientations;
};
struct GhostChanges {
  ListChanges<BodyId> outside;
  std::vector<std::uint8_t> kinds, changed_axes;
  std::vector<double> numbers;
  std::vector<Vec3> vectors;
};
struct Changes {
  std::uint64_t base_stamp = 0;
  ListChanges<BodyId> members, fixed;
  ListChanges<std::uint32_t> islands;
  StateChanges states;
  GhostChanges ghosts;
  std::vector<CarriedBody> carried;
};

bool fields(auto& archive, auto& m) requires requires { m.as_in_base; }
{ return archive("as_in_base", m.as_in_base) && archive("values", m.values); }
bool fields(auto& archive, Is<StateChanges> auto& m) {
  return archive("bodies", m.bodies) && archive("changed", m.changed) && archive("vectors", m.vectors) &&
         archive("orientations", m.orientations);
}
bool fields(auto& archive, Is<GhostChanges> auto& m) {
  return archive("outside", m.outside) && archive("kinds", m.kinds) && archive("changed_axes", m.changed_axes) &&
         archive("numbers", m.numbers) && archive("vectors", m.vectors);
}
/// The inertia of a carried body. One that no body can have is invalid.
bool fields(auto& archive, Is<Eigen::Matrix3d> auto& m) {
  if (!archive("xx", m(0, 0)) || !archive("yy", m(1, 1)) || !archive("zz", m(2, 2)) || !archive("xy", m(0, 1)) ||
      !archive("yz", m(1, 2)) || !archive("zx", m(2, 0)))
    return false;
  if constexpr (!std::is_const_v<std::remove_reference_t<decltype(m)>>) {
    m(1, 0) = m(0, 1);
    m(2, 1) = m(1, 2);
    m(0, 2) = m(2, 0);
    return archive.check(is_positive_definite(m));
  }
  return true;
}

void pack(const WorldFrame& frame, Delta delta, Changes& changes);
void pack(const HapticReport& report, Delta delta, Changes& changes);
/// False where what was received does not fit together.
[[nodiscard]] bool unpack(const Changes& changes, Delta delta, WorldFrame& frame);
[[nodiscard]] bool unpack(const Changes& changes, Delta delta, HapticReport& report);

/// The last messages of one direction of a topic. Their memory comes with the first one.
class Bases {
 public:
  /// Null if it is not there.
  [[nodiscard]] const Base* find(const MessageIdentity& identity) const noexcept;
  /// Where the next message is noted.
  [[nodiscard]] Base& next();
  /// Remembers what was noted. A stamp that is sent again, as by a paused world, is no base: it may have other
  /// contents, and which of them the reader has confirmed is not known.
  void keep() noexcept;

 private:
  std::vector<Base> kept_;  ///< by stamp
  Base next_;
};

}  // namespace subworld
