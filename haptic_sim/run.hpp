#pragma once

#include "haptic_sim/measures.hpp"
#include "haptic_sim/ports.hpp"
#include "haptic_sim/sub_world.hpp"
#include "io/ending.hpp"
#include "rt/cyclic.hpp"

#include <optional>

namespace subworld {

/// The first frame and when it came.
struct FirstFrame {
  WorldFrame frame;
  TimePoint received;
};

/// Waits until the world's scene, the device and the first frame are there, and makes the frame the sub-world.
/// None when asked to stop. Throws `Error` (failed, usage) that names what is missing.
[[nodiscard]] std::optional<FirstFrame> join(HapticPorts& ports, SubWorld& sub, const Scene& scene,
                                             const Options& options);

/// Nobody looks at a clock: each step waits for its device state, each cycle for its frame. Ends with the frame that is
/// the last, or when asked to stop. Throws `Error` (failed) when a peer dies or is started again.
[[nodiscard]] Ending run_lockstep(HapticPorts& ports, SubWorld& sub, HapticMeasures& measures, EngineExchange& exchange,
                                  const Scene& scene);

/// Nobody waits: absolute deadlines, the newest data, what comes late is counted and used late. A fault where the world
/// or the device has gone or was started again; the force has faded by then. `spin`: see
/// Cyclic.
[[nodiscard]] Ending run_realtime(HapticPorts& ports, SubWorld& sub, HapticMeasures& measures, EngineExchange& exchange,
                                  const Scene& scene, const FirstFrame& first, Duration spin);

}  // namespace subworld
