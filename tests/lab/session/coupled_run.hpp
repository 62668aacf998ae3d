#pragma once

#include "coupling/messages/deadband.hpp"
#include "coupling/messages/delay.hpp"
#include "device_sim/device_guard.hpp"
#include "device_sim/emulated_device.hpp"
#include "haptic_sim/lockstep_order.hpp"
#include "haptic_sim/sub_world.hpp"
#include "model/scene/scene.hpp"
#include "rt/histogram.hpp"
#include "world_sim/world.hpp"

#include <memory>
#include <utility>
#include <vector>

namespace subworld {

/// Forces and motion of one user, one entry per haptic step, at the proxy.
struct FeltHistory {
  std::vector<Vec3> force;        ///< N, of the coupling, before the ramp
  std::vector<Vec3> torque;       ///< N m, likewise
  std::vector<Vec3> on_operator;  ///< N, of the device on the operator
  std::vector<BodyState> proxy;
  std::vector<DeviceState> device;  ///< as read, of one user among several
  double work_j = 0.0;              ///< that the operator has put in, without what came back
};

/// CPU times, s per call.
struct CpuTimes {
  Histogram world;        ///< a cycle of the world
  Histogram haptic;       ///< a haptic step
  Histogram synchronise;  ///< synchronisation of the sub-world with a frame
};

/// The reference of a scene: all of it in one world at step h, without delay and without a bound on the energy of the
/// devices.
[[nodiscard]] Scene in_one_world(Scene scene);

/// The whole system in lock-step in one process, without a bus: the same ticks in the same order, with the artificial
/// delays of the settings.
class CoupledRun {
 public:
  /// `make` makes the world's engine.
  explicit CoupledRun(const Scene& scene, const EngineMaker& make = make_engine);

  /// Before the first cycle. The sub-worlds know the motion of the other users' devices without delay.
  void know_peers_at_once();
  /// Before the first cycle. In place of its own, the user's device has these states, one for each haptic step.
  void replay(std::size_t user, std::vector<DeviceState> states) { replayed_[user] = std::move(states); }

  /// Makes r haptic steps of every user, and the world's cycle.
  void cycle();
  /// Runs until the world has reached the scene's duration. Returns false if a state or force is no longer finite.
  bool run();
  /// Call after the last cycle: the last reports correct the world, as at the end of a run of the programs.
  void close();
  [[nodiscard]] bool finite() const noexcept;
  /// Hash of the world's states and of all forces on operators.
  [[nodiscard]] std::uint64_t hash() const noexcept;

  [[nodiscard]] WorldFrame& frame(std::size_t user = 0) { return world.frame(user); }
  /// Share of the states and commands of a device that a link with the deadband of the settings sends.
  [[nodiscard]] double device_sent_ratio(std::size_t user = 0) const noexcept {
    return 0.5 * (links_[user].deadband.sent_ratio() + links_[user].order.sent_ratio());
  }
  /// Whether the last cycle sent a frame or a report.
  [[nodiscard]] bool sent_frame(std::size_t user = 0) const { return world.user_facts(user).waits_for_frame; }
  [[nodiscard]] bool sent_report(std::size_t user = 0) const { return links_[user].reported; }
  /// The newest report of the user's sub-world.
  [[nodiscard]] const HapticReport& report(std::size_t user = 0) const {
    return links_[user].reports[links_[user].newest_report % links_[user].reports.size()];
  }
  /// The report of this stamp; null if there is none, or none any more.
  [[nodiscard]] const HapticReport* report_of(std::size_t user, std::uint64_t stamp) const {
    const HapticReport& kept = links_[user].reports[stamp % links_[user].reports.size()];
    return kept.sent_ns != 0 && kept.stamp == stamp ? &kept : nullptr;
  }

 private:
  struct Link {
    Delay delay;  ///< of reports
    LockstepOrder order;
    Deadband<DeviceState> deadband;
    Wrench felt;                        ///< by the operator
    std::vector<HapticReport> reports;  ///< by stamp
    std::vector<WorldFrame> frames;     ///< by stamp
    std::uint64_t next_report = 0;      ///< that the world uses
    std::uint64_t newest_report = 0;
    bool reported = false;  ///< in the last cycle of the run
  };
  void haptic_cycles();
  void read_device(std::size_t user);
  void haptic_step(std::size_t user);
  void deliver_reports(std::size_t user);
  void send_report(std::size_t user);
  void deliver_frames(std::size_t user);

  Scene scene_;
  std::uint64_t cycle_ = 0;         ///< of the world and its lead
  std::uint64_t haptic_cycle_ = 0;  ///< of the sub-worlds, which are ahead during message suppression
  std::vector<Link> links_;
  std::vector<DeviceState> states_;                 ///< of the devices in the present step
  std::vector<std::vector<DeviceState>> replayed_;  ///< by user

 public:
  World world;
  std::vector<std::unique_ptr<SubWorld>> subs;
  std::vector<std::unique_ptr<EmulatedDevice>> devices;
  std::vector<std::unique_ptr<DeviceGuard>> guards;
  std::vector<FeltHistory> felt;  ///< by user
  CpuTimes cpu;
  double haptic_step_s = 0.0;  ///< that each haptic step is said to take; 0: not known
};

}  // namespace subworld
