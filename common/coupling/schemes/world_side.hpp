#pragma once

#include "coupling/messages/timetable.hpp"
#include "coupling/select/contact_graph.hpp"
#include "coupling/select/selection.hpp"
#include "coupling/tool/virtual_coupling.hpp"
#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"
#include "physics/shells/resting_engine.hpp"

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

namespace subworld {

/// The motion of a body over the last cycle.
struct Motion {
  BodyState state;                   ///< at its end
  Vec3 acceleration = Vec3::Zero();  ///< mean, m/s^2
  double energy_j = 0.0;             ///< kinetic and potential
  double least_j = INFINITY;         ///< of it, since the start
  double fallen_j = 0.0;             ///< below the least of before, in the cycle
};

/// How a user's device pulls the proxy.
struct UserPull {
  BodyId proxy{};
  Vec3 force_n = Vec3::Zero();  ///< mean over the last cycle
  bool spring = true;           ///< else the operator's force itself, of an admittance device
};

/// The world at one stamp, as frames are made from it.
struct WorldNow {
  std::uint64_t stamp = 0;
  double stamp_s = 0.0;
  double cycle_s = 0.0;  ///< length of the cycle that ended here
  const Timetable& timetable;
  const RestingEngine& engine;
  const std::span<const Contact>& contacts;    ///< totals over the last cycle
  const std::function<bool()>& find_friction;  ///< of the contacts; false where it was there
  const ContactGraph& graph;                   ///< of the contacts
  std::span<const Motion> motions;             ///< by body
  std::span<const UserPull> pulls = {};
};

/// One user's sub-world within it.
struct Inside {
  const Membership& membership;
  Box reach;                                  ///< all places that members may reach until the next frame is used
  double horizon_s = 0.0;                     ///< how long this frame will be all that the sub-world knows
  const std::function<bool(BodyId)>& shared;  ///< whether other sub-worlds hold the body as well
};

/// A body at the border whose state the sub-world gets.
struct OutsideBody {
  BodyId id{};
  std::uint8_t form = 0;  ///< that the scheme gives it there; where this changes, the body begins anew
};

/// What is around a sub-world at one stamp.
struct Border {
  std::vector<BoundaryContact> contacts;
  std::vector<OutsideBody> outside;  ///< ascending
  std::vector<BodyId> pushing;       ///< proxies of other users whose devices the sub-world needs
};

/// How the user acts on the world's copy of the proxy during one step of the world's engine.
struct ProxyDrive {
  Wrench wrench;                     ///< constant
  std::optional<DevicePose> target;  ///< if set: a spring of the coupling's stiffness to it, implicit, on top
  ForceLimits limits;                ///< of that spring
};

/// Mean wrench of the user on the proxy between two reports; zero where no time lies between them.
[[nodiscard]] Wrench mean_wrench(const HapticReport& before, const HapticReport& now) noexcept;

/// A scheme's side in the world process.
class WorldSide {
 public:
  virtual ~WorldSide() = default;

  /// The user's action on the world's proxy in the step that ends at `until_s`. `mean` is the user's wrench in the
  /// cycle (coupling/tool/impulse_account), `now` the report of the cycle's end or the newest there is, `before` the
  /// one before it.
  [[nodiscard]] virtual ProxyDrive drive(const UserSpec& user, const Wrench& mean, const HapticReport& before,
                                         const HapticReport& now, double until_s) const = 0;
  /// A new stamp, of which `extract` follows for each user. Not called without sub-worlds.
  virtual void begin(const WorldNow& /*now*/) {}
  /// Fills `border`, which is as it was at the stamp before, and of the frame the islands and what only the scheme
  /// reads. Not called without sub-worlds.
  virtual void extract(const WorldNow& now, const Inside& inside, Border& border, WorldFrame& frame) = 0;
};

}  // namespace subworld
