#pragma once

#include "model/disjoint_sets.hpp"
#include "model/scene/scene.hpp"
#include "physics/box_tree.hpp"
#include "physics/shells/engine_shell.hpp"
#include "physics/shells/settling.hpp"

#include <span>
#include <utility>
#include <vector>

namespace subworld {

/// An engine that does not simulate resting bodies. Bodies that are connected by contacts and have not moved for a
/// while leave the inner engine together, and return before anything can reach them. Meanwhile they cost no step, no
/// contact and no message. Queries return their last place, without velocity; overlap() does not list them.
///
/// A body is *still* while it stays within `kDrift` of its thickness of one place. Still bodies sleep when all bodies
/// that they touch are still too, nothing has come near for `kStillFor_s`, and they are *held*: what fixed bodies they
/// touch push with carries their weight, or none has weight and none moves. Where gravity is weaker than `kUsual_m_s2`,
/// that time is longer, so that what falls half as fast is watched for longer. A body wakes, with all bodies that sleep
/// with it,
///   * when a moving body may reach it within the horizon of `follow`. The test uses a box around all places that the
///   moving body may reach by its velocity, by turning and by falling, and those that the bodies it pushes may reach;
///   * when the caller sets its state, velocity or inertia, or pushes it.
/// Bodies with `at_rest` in the scene sleep from the start; those whose boxes touch wake together. The bodies that
/// support a sleeping body are fixed, or sleep and wake with it. With `rests` false nothing sleeps.
///
/// With `settles`, oscillating structures that no operator reaches are damped. A body that has been damped for long
/// counts as still although it trembles or creeps (Settling).
class RestingEngine final : public EngineShell {
 public:
  /// `restless` bodies never sleep and always count as moving. `inner` and `scene` must outlive this object.
  RestingEngine(Engine& inner, const Scene& scene, std::span<const BodyId> restless, bool rests, bool settles);

  /// Call after each step, or after several steps of together `dt` (s): decides which bodies are still, wake and sleep.
  /// `horizon_s`: time until the next call.
  void follow(double dt, double horizon_s);
  /// Simulated movable bodies, in ascending order.
  [[nodiscard]] std::span<const BodyId> awake() const noexcept { return awake_; }
  [[nodiscard]] bool asleep(BodyId id) const noexcept { return things_[index(id)].asleep; }
  [[nodiscard]] std::size_t asleep_count() const noexcept { return asleep_count_; }
  /// Bodies that fell asleep in the last follow(), and those that woke since the one before.
  [[nodiscard]] std::span<const BodyId> fell_asleep() const noexcept { return slept_; }
  [[nodiscard]] std::span<const BodyId> woke() const noexcept { return woke_; }
  /// For callers that need every body in the inner engine, as an exchange of engines does.
  void wake_all();
  /// Sleeping bodies whose boxes intersect this one, in no order.
  void asleep_in(const Box& box, std::vector<BodyId>& out) const;
  /// Whether a shift is too small to matter for a sleeping body.
  [[nodiscard]] bool negligible(BodyId id, const BodyState& to) const;

  /// Without checkpoints: those of the inner engine would not contain sleeping bodies.
  Capabilities capabilities() const noexcept override;
  using EngineShell::add;
  void add(const Body& body, const BodyState& state, Role role) override;
  void remove(BodyId id) override;
  bool contains(BodyId id) const noexcept override { return asleep(id) || inner_.contains(id); }
  BodyState state(BodyId id) const override { return asleep(id) ? things_[index(id)].anchor : inner_.state(id); }
  Box bounds(BodyId id) const override { return asleep(id) ? things_[index(id)].bounds : inner_.bounds(id); }

  Checkpoint checkpoint() const override;
  void restore(const Checkpoint& checkpoint) override;

  static constexpr double kStillFor_s = 0.25;
  static constexpr double kDrift = 1e-3;  ///< of the thickness
  static constexpr double kUsual_m_s2 = 9.81;
  static constexpr double kHeld = 0.5;           ///< of the weight, that may be missing in one step of a solver
  static constexpr double kFloats_per_s = 1e-5;  ///< speed, in thicknesses, below which a body without weight rests

 private:
  Engine& inner() const noexcept override { return inner_; }
  void stepped(double dt) override;
  /// Wakes the body, which must settle again.
  Engine& moved(BodyId id) override;
  struct Thing {
    BodyState anchor;          ///< place at which the body has been still, or sleeps
    Box bounds;                ///< at the anchor
    double still_s = 0.0;      ///< time for which it has been still
    double unreached_s = 0.0;  ///< time for which nothing came near
    double thickness_m = 0.0;
    double drift_m = 0.0;            ///< drift that counts as none
    double tolerance_m = 0.0;        ///< radius around the anchor that counts as still
    double arm_m = 0.0;              ///< from the centre to the farthest point
    Vec3 pushed_n_s = Vec3::Zero();  ///< by fixed bodies, in the step of the last look
    std::uint32_t next = 0;          ///< next body of those that sleep together: a ring
    bool restless = false;
    bool asleep = false;
    bool reached = false;
    bool in_reach = false;  ///< of roots: a restless body may reach one of the island
  };
  /// Places that something may reach, and from which it may push other bodies.
  struct Reach {
    Box from;
    double travel_m = 0.0;
  };

  /// From the bodies that sleep with it, or that it touches.
  void separate(std::uint32_t one) noexcept {
    things_[one].next = one;
    sets_.separate(one);
  }
  void join(std::uint32_t one, std::uint32_t other) noexcept;
  void watch(BodyId id, double dt);
  void reach_from(BodyId mover, double horizon_s);
  void wake(std::uint32_t one);
  void lay_asleep(std::uint32_t one);
  /// Bodies that are connected by contacts, after a step of `dt`.
  void find_islands(double dt);
  /// Whether what surrounds these bodies carries them.
  [[nodiscard]] bool are_held(std::span<const BodyId> together) const;
  /// Which islands an operator may reach.
  void find_operators(double horizon_s);
  /// Which islands settle, and which fall asleep.
  void judge_islands();
  void sleep(std::uint32_t one);

  Engine& inner_;
  const Scene& scene_;
  bool rests_;
  double gravity_m_s2_;
  double still_for_s_;
  Settling settling_;
  std::vector<Thing> things_;  ///< by body
  DisjointSets sets_;          ///< of bodies: islands while they are searched, those that sleep together
  BoxTree still_;              ///< still bodies, asleep or not
  std::vector<BodyId> awake_;
  std::vector<BodyId> waking_, woke_, slept_;
  std::vector<Reach> frontier_;
  std::vector<std::uint32_t> reached_;
  std::vector<BodyId> near_;
  std::vector<std::pair<std::uint32_t, BodyId>> islands_;  ///< root and body
  std::vector<BodyId> together_;
  double since_look_s_ = 0.0;
  double looked_at_s_ = 0.0;    ///< length of the step of the last look
  bool islands_known_ = false;  ///< of the last step
  std::size_t asleep_count_ = 0;
};

}  // namespace subworld
