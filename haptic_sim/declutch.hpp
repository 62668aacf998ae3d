#pragma once

#include "coupling/tool/virtual_coupling.hpp"
#include "model/messages/exchange.hpp"

namespace subworld {

/// Where the device is in the scene: device position + offset, device orientation * turn. Wherever a device is when it
/// is first heard, that place is the proxy's start; its orientation is measured from the proxy's there. While it is
/// declutched the device may move without moving in the scene.
class Declutch {
 public:
  explicit Declutch(const BodyState& proxy_start) noexcept : start_(proxy_start), turn_(proxy_start.orientation) {
    device_.pose = {start_.position, start_.orientation};
  }

  /// `rate`: simulated seconds per second, > 0. A device measures its velocity in wall time, the scene has its own
  /// time.
  void follow(const DeviceState& device, double rate) noexcept {
    if (placed_) {
      offset_ = device_.pose.position - device.pose.position;
      turn_ = (device.pose.orientation.conjugate() * device_.pose.orientation).normalized();
    } else if (!heard_) {
      offset_ = start_.position - device.pose.position;
    } else if (open_) {
      offset_ = device_.pose.position - device.pose.position;
    }
    heard_ = true;
    placed_ = false;
    device_.pose.position = device.pose.position + offset_;
    device_.pose.orientation = device.pose.orientation * turn_;
    device_.linear_velocity = open_ ? Vec3::Zero() : Vec3(device.linear_velocity / rate);
    device_.angular_velocity = open_ ? Vec3::Zero() : Vec3(device.angular_velocity / rate);
  }
  /// Extrapolates the device by `dt` of simulated time without a new state.
  void advance(double dt) noexcept { device_.pose.position += dt * device_.linear_velocity; }
  void open(bool open) noexcept { open_ = open; }
  /// From now on the device is there in the scene, wherever its next state says that it is.
  void place(const Pose& pose) noexcept {
    device_ = {.pose = pose};
    placed_ = true;
  }

  [[nodiscard]] bool is_open() const noexcept { return open_; }
  [[nodiscard]] const DevicePose& device() const noexcept { return device_; }
  [[nodiscard]] const Vec3& offset() const noexcept { return offset_; }
  [[nodiscard]] const Quat& turn() const noexcept { return turn_; }

 private:
  BodyState start_;
  DevicePose device_;  ///< in scene coordinates and simulated time
  Vec3 offset_ = Vec3::Zero();
  Quat turn_;
  bool heard_ = false;
  bool open_ = false;
  bool placed_ = false;  ///< the next state is of a device that is at device_
};

}  // namespace subworld
