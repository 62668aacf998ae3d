#pragma once

#include "haptic_sim/loops/measures.hpp"
#include "haptic_sim/loops/ports.hpp"
#include "haptic_sim/sub_world.hpp"
#include "io/ending.hpp"
#include "rt/cyclic.hpp"

#include <optional>

namespace subworld {

/// `Ending::by` of a run that the world has ended.
inline constexpr const char* kLastFrame = "last frame";

/// Everything that a run of a haptic process consists of.
struct HapticRun {
  const Options& options;
  const Scene& scene;
  HapticPorts& ports;
  SubWorld& sub;
  HapticMeasures& measures;
  EngineExchange& exchange;
  SessionFinder& finder;

  [[nodiscard]] std::uint32_t user() const noexcept { return static_cast<std::uint32_t>(options.user); }
  [[nodiscard]] const SchemeProperties& scheme() const { return scheme_of(scene.settings).properties; }
  /// Follows orders to change the sub-world's engine, between two steps and without waiting. Returns engine and preset
  /// of the change that it has begun with; empty: none.
  std::string follow_orders() const;
  /// Uses the engine that has been ordered, once it is ready.
  void follow_exchange() const;
};

/// The first frame and when it came.
struct FirstFrame {
  WorldFrame frame;
  TimePoint received;
  double round_trip_s = 0.0;  ///< of an answer to a standing frame, at least; 0: not known
};

/// Waits until the world's scene, the device and the first frame are there, and makes the frame the sub-world.
/// None when asked to stop. Throws `Error` (failed, usage) that names what is missing.
[[nodiscard]] std::optional<FirstFrame> join(const HapticRun& run);

/// The same in lock-step, once the device is there: asks the world to take part, and waits for the frame from which the
/// sub-world begins; or for the last one.
[[nodiscard]] std::optional<FirstFrame> begin_lockstep(const HapticRun& run);

/// Lock-step: each step waits for its device state, each cycle for its frame. Ends with the frame that is the last, or
/// when asked to stop. Throws `Error` (failed) when a peer dies or is started again.
[[nodiscard]] Ending run_lockstep(const HapticRun& run, const FirstFrame& first);

/// Real time: absolute deadlines, the newest data; what comes late is counted and used late. A fault where the world
/// or the device has gone or was started again; the force has faded by then.
[[nodiscard]] Ending run_realtime(const HapticRun& run, const FirstFrame& first);

}  // namespace subworld
