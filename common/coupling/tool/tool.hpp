#pragma once

#include "model/body.hpp"
#include "model/scene/scene.hpp"

#include <algorithm>
#include <optional>
#include <utility>

namespace subworld {

/// The tool (the proxy and its coupling to the device) on a slowed clock. An operator moves in wall time whatever the
/// world's clock does, engines integrate in simulated time. The operator holds the tool, so that its dynamics are those
/// of wall time.
///
///   tau   s          wall time
///   t     s          simulated time
///   f     1          rate of the clock, dt / dtau
///   x_d   m          position of the device
///   w_d   m/s        its velocity in wall time, dx_d / dtau: what a device measures
///   x     m          position of the proxy
///   v     m/s        its velocity in simulated time, dx / dt: what an engine knows
///   w     m/s        its velocity in wall time, dx / dtau = f v
///   m     kg         its mass
///   K, B  N/m, N s/m stiffness and damping of the coupling
///   F_c   N          contact forces and weight
///
/// The equation of motion is the same at each f as at f = 1 (Colgate 1995):
///   m dw/dtau = K (x_d - x) + B (w_d - w) + F_c.                         (1)
/// In simulated time, with w = f v and d/dtau = f d/dt, it becomes:
///   f^2 m dv/dt = K (x_d - x) + f B (w_d / f - v) + F_c.                 (2)
/// This is the usual coupling with the damping f B. Its device has the velocity w_d / f, its proxy the mass f^2 m.
/// Rotation likewise has the inertia f^2 I. Forces are the same in both times, and so are energies:
///   f^2 m v^2 / 2 = m w^2 / 2,   F w_d dtau = F (w_d / f) dt.            (3)
/// When f changes, the device moves on, and so does w:
///   v' = v f / f'.                                                       (4)
/// This keeps the tool's kinetic energy and the force on the operator.
///
/// Against a body that does not move, the felt force is therefore the same at each f. A movable body of mass M
/// lives in simulated time: the operator feels M / f^2.
///
/// Tried instead: the damping f B, but the mass m. The operator then holds a tool of mass m / f^2, 40 kg for 0.1 kg at
/// f = 0.05. The damping ratio of its coupling is f times that at f = 1, and the operator pays for its kinetic energy
/// when f falls. Scene `press` at f = 0.05 takes 1.24 J of work then; at f = 1 it takes 0.12 J, and so it does here.
struct Tool {
  CouplingSettings coupling;  ///< with the damping f B
  Body body;                  ///< with the mass f^2 m and the inertia f^2 I; nameless
};

/// Least rate that is used, a half of the world's slowest clock: what divides by f stays finite on a clock that comes
/// to a stop.
inline constexpr double kLeastToolRate = 0.01;

/// The tool of a user in simulated time, at a clock of the rate f > 0.
[[nodiscard]] Tool tool_at(double rate, const UserSpec& user, const Body& proxy) noexcept;

/// The proxy's state when the rate changes, by equation (4).
[[nodiscard]] BodyState at_rate(BodyState proxy, double before, double after) noexcept;

/// A user's tool on a clock whose rate changes.
class RatedTool {
 public:
  RatedTool(const UserSpec& user, const Body& proxy) noexcept
      : user_(user), proxy_(proxy), tool_(tool_at(rate_, user, proxy)) {}

  /// From now on the rate is this one, at least kLeastToolRate. Returns the one before where it differs.
  std::optional<double> change(double rate) noexcept {
    const double before = std::exchange(rate_, std::max(rate, kLeastToolRate));
    if (rate_ == before) return {};
    tool_ = tool_at(rate_, user_, proxy_);
    return before;
  }
  [[nodiscard]] double rate() const noexcept { return rate_; }
  [[nodiscard]] const Tool& at_rate() const noexcept { return tool_; }

 private:
  const UserSpec& user_;
  const Body& proxy_;
  double rate_ = 1.0;
  Tool tool_;
};

}  // namespace subworld
