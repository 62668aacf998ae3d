#pragma once

#include "device_sim/emulated_device.hpp"
#include "haptic_sim/sub_world.hpp"
#include "model/scene.hpp"
#include "world_sim/world.hpp"

#include <memory>
#include <vector>

namespace subworld::test {

/// The whole system in lock-step in one process, without a bus: the same ticks in the same order.
class CoupledRun {
 public:
  explicit CoupledRun(const Scene& scene);

  /// One cycle of the world, r steps of every user.
  void cycle();
  void run() {
    while (world.time_s() < scene_.settings.duration_s - 1e-9) cycle();
  }

  [[nodiscard]] WorldFrame& frame(std::size_t user = 0) { return world.frame(user); }

 private:
  Scene scene_;

 public:
  World world;
  std::vector<std::unique_ptr<SubWorld>> subs;
  std::vector<std::unique_ptr<EmulatedDevice>> devices;
  std::vector<std::vector<Vec3>> felt;        ///< by user, one per haptic step, on the proxy
  std::vector<std::vector<BodyState>> proxy;  ///< by user, one per haptic step
  std::vector<HapticReport> reports;          ///< by user, the newest
};

/// sqrt(sum |F - R|^2 / sum |R|^2) over the common length.
[[nodiscard]] double rms_error(const std::vector<Vec3>& force, const std::vector<Vec3>& reference);

}  // namespace subworld::test
