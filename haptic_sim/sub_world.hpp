#pragma once

#include "coupling/contact_graph.hpp"
#include "coupling/force_guard.hpp"
#include "coupling/scheme.hpp"
#include "coupling/synchroniser.hpp"
#include "haptic_sim/ghosts.hpp"
#include "model/exchange.hpp"
#include "model/scene.hpp"
#include "physics/engine_exchange.hpp"

#include <algorithm>
#include <memory>
#include <vector>

namespace subworld {

/// What one haptic step brought.
struct FeltStep {
  Wrench felt;     ///< on the proxy, by the coupling at the start of the step
  Wrench to_hand;  ///< for the device: bounded, finite, ramped
};

/// One user's haptic sub-world: a small copy of the world around the proxy, stepped at the haptic rate, coupled to the
/// device and corrected from the world. A cycle is: `report`, `apply` of the world's frame of the same stamp, r steps.
class SubWorld {
 public:
  SubWorld(const Scene& scene, std::size_t user);

  /// One haptic step that covers `dt` of simulation time: h, unless a clock is caught up with. `device_trusted`: its
  /// state is fresh.
  FeltStep step(const DeviceState& device, bool device_trusted, double dt);
  /// The force for the device at the start of the step, before the sub-world moves: so that it leaves without delay.
  [[nodiscard]] FeltStep feel(const DeviceState& device, bool device_trusted, double dt);
  void advance(double dt);
  /// What the hand feels fades out, and it is met again from zero.
  void let_go() noexcept { guard_.let_go(); }
  /// While the sub-world's clock stands: the hand may go where it likes, and is met there when the clock goes on.
  void stand(bool stands) noexcept { stands_ = stands; }

  /// True when the steps since the last boundary fill a cycle: `report` is due.
  [[nodiscard]] bool at_boundary() const noexcept;
  /// True before the first step of a cycle.
  [[nodiscard]] bool at_cycle_start() const noexcept { return steps_ == 0 || at_boundary(); }
  /// Whether a frame of this stamp may be used now: not before the sub-world has reached it.
  [[nodiscard]] bool accepts(std::uint64_t frame_stamp) const noexcept { return !engine_ || frame_stamp <= stamp_; }
  /// Closes the cycle; the reference lives for several cycles. `sent_ns` is the caller's clock.
  const HapticReport& report(std::int64_t sent_ns);

  /// Uses a frame whose stamp is not ahead of stamp(): blends, bodies that enter and leave, border.
  /// Returns the number of frames that are missing before it; a frame that is older than the newest one, or names
  /// bodies that the scene does not have, does nothing.
  std::uint64_t apply(const WorldFrame& frame);
  /// Gives up what the sub-world holds and starts again from the world's: for one that fell behind or is not finite.
  /// False where the frame brings no proxy: it is no beginning.
  bool adopt(const WorldFrame& frame);

  /// Asks for another engine. Returns what came of it, in words; exchange_engine() hands over between two steps,
  /// when the other one is ready, and lets the hand feel it gently.
  std::string change_engine(EngineExchange& exchange, const EngineOrder& order);
  bool exchange_engine(EngineExchange& exchange);

  [[nodiscard]] std::size_t user() const noexcept { return user_; }
  [[nodiscard]] std::uint64_t stamp() const noexcept { return stamp_; }
  [[nodiscard]] double time_s() const noexcept;
  /// Simulation time until the next boundary.
  [[nodiscard]] double cycle_left_s() const noexcept;
  [[nodiscard]] bool finite() const noexcept { return finite_; }
  [[nodiscard]] BodyState proxy() const;
  [[nodiscard]] const Vec3& clutch() const noexcept { return clutch_; }
  [[nodiscard]] const DevicePose& device() const noexcept { return device_; }
  [[nodiscard]] std::size_t members() const noexcept { return members_.size(); }
  [[nodiscard]] std::size_t contacts() const noexcept;
  [[nodiscard]] std::size_t border_pairs() const noexcept {
    return static_cast<std::size_t>(std::ranges::count_if(frame_.border, touches));
  }
  [[nodiscard]] double device_work_j() const noexcept { return device_work_j_; }
  [[nodiscard]] const Engine& engine() const noexcept { return *engine_; }
  [[nodiscard]] const Scheme& scheme() const noexcept { return *scheme_; }

 private:
  void place_device(const DeviceState& device);
  void follow_membership(const WorldFrame& frame, double lag_s);
  void follow_ghosts(const WorldFrame& frame, double lag_s);
  void describe_islands(std::vector<std::uint32_t>& labels);
  [[nodiscard]] bool knows(const WorldFrame& frame) const noexcept;
  void let_peers_go();
  void hold(BodyId proxy, const ImplicitStep& coupling);
  void move_peers(double dt);
  void observe_contacts();

  const Scene& scene_;
  std::size_t user_;
  const UserSpec& spec_;
  std::unique_ptr<Scheme> scheme_;
  std::unique_ptr<LiveEngine> engine_;  ///< none: the proxy lives in the world alone
  Synchroniser synchroniser_;
  ForceLimits limits_;
  ForceGuard guard_;

  WorldFrame frame_;  ///< newest used
  BodyState world_proxy_;
  std::vector<BodyId> members_;
  std::vector<BodyId> fixed_;
  std::vector<PointImpulse> border_impulses_;
  double border_impulses_for_s_ = 0.0;
  std::size_t border_bodies_ = 0;
  Ghosts ghosts_;
  Islands islands_;

  std::uint64_t stamp_ = 0;
  double in_cycle_s_ = 0.0;
  int steps_ = 0;
  Indicators indicators_;
  Wrench impulse_;
  Wrench impulse_total_;
  double device_work_j_ = 0.0;
  Wrench felt_;
  DevicePose device_;
  Wrench applied_;
  Vec3 clutch_ = Vec3::Zero();  ///< device position + clutch = position in the scene
  bool clutched_ = false;
  bool stands_ = false;
  bool finite_ = true;
  std::vector<HapticReport> reports_;  ///< by stamp
  std::vector<BodyId> scratch_;
};

}  // namespace subworld
