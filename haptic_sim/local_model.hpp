#pragma once

#include "coupling/schemes/scheme.hpp"
#include "coupling/tool/tool.hpp"
#include "coupling/tool/virtual_coupling.hpp"
#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"
#include "physics/shells/live_engine.hpp"

#include <cstdint>
#include <memory>
#include <span>

namespace subworld {

/// How the user acts on the proxy in one step.
struct Drive {
  DeviceKind kind;
  const Tool& tool;
  const ForceLimits& limits;
  const DevicePose& device;
  const Wrench& applied;                      ///< of an admittance device, within the limits
  const Wrench& felt;                         ///< of the coupling when the step begins
  std::span<const DeviceState* const> peers;  ///< see StepInput
};

/// How old the world's state is where the sub-world uses it.
struct Age {
  double s = 0.0;
  double cycles = 0.0;
};

/// What a haptic process has of the world: a sub-world that it simulates, or the proxy's state as the world tells it.
class LocalModel {
 public:
  virtual ~LocalModel() = default;

  /// Simulates `dt` from `time_s` on. Returns the mean wrench of the user on the proxy; adds to the indicators.
  virtual Wrench advance(const Drive& drive, double time_s, double dt, Indicators& indicators) = 0;
  /// From now on the clock runs at another rate: the tools' velocities, masses and couplings change
  /// (coupling/tool/tool).
  virtual void change_rate(double before, double after) = 0;
  /// Uses a frame. `mine` is what was reported of the same stamp, or null.
  virtual void follow(const WorldFrame& frame, const HapticReport* mine, const Age& age) = 0;
  /// Gives up what there is and begins with a frame. False where it brings no proxy.
  virtual bool reset_from(const WorldFrame& frame) = 0;
  /// Adds members and islands to a report, and remembers the rest.
  virtual void describe(HapticReport& report) = 0;

  /// At its start before the first frame.
  [[nodiscard]] virtual BodyState proxy() const = 0;
  [[nodiscard]] virtual std::size_t members() const noexcept = 0;
  [[nodiscard]] virtual std::size_t contacts() const noexcept = 0;
  /// See SubWorldFacts.
  [[nodiscard]] virtual std::uint64_t peers() const noexcept = 0;
  /// Work of the other operators on what this one feels since the start, J (coupling/safety/energy_port).
  [[nodiscard]] virtual OthersEnergy others() const noexcept = 0;
  /// The engine that simulates it; null where there is none.
  [[nodiscard]] virtual LiveEngine* engine() noexcept = 0;
  /// Whether a report tells how a cycle went. Else it tells with which device pose one begins.
  [[nodiscard]] virtual bool reports_afterwards() const noexcept = 0;
};

/// As the scheme wants it.
[[nodiscard]] std::unique_ptr<LocalModel> make_local_model(const Scheme& scheme, const Scene& scene, std::size_t user);

}  // namespace subworld
