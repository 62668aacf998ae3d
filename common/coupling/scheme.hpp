#pragma once

#include "coupling/border.hpp"
#include "coupling/virtual_coupling.hpp"
#include "model/exchange.hpp"
#include "model/scene.hpp"

#include <memory>
#include <optional>
#include <string_view>
#include <vector>

namespace subworld {

/// How the user acts on the world's copy of the proxy during the next cycle.
struct ProxyDrive {
  Wrench wrench;                     ///< constant
  std::optional<DevicePose> device;  ///< if set: the virtual coupling to it, implicit, on top
};

/// A coupling scheme: pure functions over model data. The processes ask, they do not know which one runs.
class Scheme {
 public:
  virtual ~Scheme() = default;

  [[nodiscard]] virtual std::string_view name() const noexcept = 0;

  /// False: the proxy lives in the world alone; nothing is selected, extracted or blended.
  [[nodiscard]] virtual bool has_sub_world() const noexcept = 0;

  /// What the user does to the world's proxy over a cycle of `cycle_s`, given the newest report.
  [[nodiscard]] virtual ProxyDrive drive(const UserSpec& user, const HapticReport& report, double cycle_s) const = 0;

  /// The outside's impulses on the sub-world in one haptic step, which is `fraction` of a world step.
  virtual void border_impulses(const WorldFrame& frame, double fraction, std::vector<PointImpulse>& out) const = 0;

  /// Weight of the sub-world's copy when the two copies of a body are made one, 0 .. 1.
  [[nodiscard]] virtual double sub_weight(bool is_proxy, const Indicators& indicators) const noexcept = 0;
};

/// Throws `Error` (usage) for an unknown name, naming those that exist.
[[nodiscard]] std::unique_ptr<Scheme> make_scheme(const Settings& settings);

}  // namespace subworld
