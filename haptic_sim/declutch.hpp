#pragma once

#include "coupling/virtual_coupling.hpp"
#include "model/exchange.hpp"

namespace subworld {

/// Where the device is in the scene: device position + offset. Wherever a device is when it is first heard, that place
/// is the proxy's start. While it is declutched the device may move without moving in the scene.
class Declutch {
 public:
  explicit Declutch(const BodyState& proxy_start) noexcept : start_(proxy_start) {
    device_.pose = {start_.position, start_.orientation};
  }

  /// `rate`: simulated seconds per second, > 0. A device measures its velocity in wall time, the scene has its own
  /// time.
  void follow(const DeviceState& device, double rate) noexcept {
    if (!heard_) {
      offset_ = start_.position - device.pose.position;
      heard_ = true;
    } else if (open_) {
      offset_ = device_.pose.position - device.pose.position;
    }
    device_.pose.position = device.pose.position + offset_;
    device_.pose.orientation = device.pose.orientation * start_.orientation;
    device_.linear_velocity = open_ ? Vec3::Zero() : Vec3(device.linear_velocity / rate);
    device_.angular_velocity = open_ ? Vec3::Zero() : Vec3(device.angular_velocity / rate);
  }
  /// Extrapolates the device by `dt` of simulated time without a new state.
  void advance(double dt) noexcept { device_.pose.position += dt * device_.linear_velocity; }
  void open(bool open) noexcept { open_ = open; }

  [[nodiscard]] bool is_open() const noexcept { return open_; }
  [[nodiscard]] const DevicePose& device() const noexcept { return device_; }
  [[nodiscard]] const Vec3& offset() const noexcept { return offset_; }

 private:
  BodyState start_;
  DevicePose device_;  ///< in scene coordinates and simulated time
  Vec3 offset_ = Vec3::Zero();
  bool heard_ = false;
  bool open_ = false;
};

}  // namespace subworld
