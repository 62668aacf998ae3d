#pragma once

#include "model/scene.hpp"
#include "physics/box_tree.hpp"
#include "physics/engine_shell.hpp"
#include "physics/settling.hpp"

#include <span>
#include <utility>
#include <vector>

namespace subworld {

/// An engine that does not simulate what rests. Bodies that hang together by contacts and have stayed where they are
/// leave the inner engine together, whichever it is, and come back before anything can reach them: they cost no step,
/// no contact and no message. Meanwhile they are asked for as before: where they were, without velocity; overlap() does
/// not name them.
///
/// A body is *still* while it stays within `kDrift` of its thickness of one place. Still bodies sleep when all that
/// they touch are still too and nothing has come near for `kStillFor_s`. They wake, with all that they sleep with,
/// * when a moving body may reach them within the time that `follow` is told. Counted is a box around all places to
///   which it may get by its velocity, by turning and by falling, and what it may push in turn;
/// * when somebody sets their state, their velocity or their inertia, or pushes them.
/// Bodies that the scene says are at rest sleep from the start; those whose boxes touch wake together.
/// What a sleeping body stands on either is fixed, or sleeps and wakes with it. With `rests` false nothing sleeps.
///
/// With `settles`, what sways where no hand reaches it is damped. What has been damped for long is still although it
/// trembles or creeps (Settling).
class RestingEngine final : public EngineShell {
 public:
  /// `restless` never sleep and always count as moving. `inner` and `scene` must outlive this object.
  RestingEngine(Engine& inner, const Scene& scene, std::span<const BodyId> restless, bool rests, bool settles);

  /// Once after each step or several of together `dt` (s): who is still, who wakes and who sleeps. `horizon_s` is the
  /// time for which nobody will look again.
  void follow(double dt, double horizon_s);
  /// Movable bodies that are simulated, ascending.
  [[nodiscard]] std::span<const BodyId> awake() const noexcept { return awake_; }
  [[nodiscard]] bool asleep(BodyId id) const noexcept { return things_[index(id)].asleep; }
  [[nodiscard]] std::size_t asleep_count() const noexcept { return asleep_count_; }
  /// Of the last follow(), and what woke since the one before.
  [[nodiscard]] std::span<const BodyId> fell_asleep() const noexcept { return slept_; }
  [[nodiscard]] std::span<const BodyId> woke() const noexcept { return woke_; }
  /// For who must see every body in the inner engine, as an exchange of engines does.
  void wake_all();
  /// Sleeping bodies whose boxes meet this one, in no order.
  void asleep_in(const Box& box, std::vector<BodyId>& out) const;
  /// Whether a shift is so small that it tells nothing of a sleeping body.
  [[nodiscard]] bool negligible(BodyId id, const BodyState& to) const;

  /// Without checkpoints: the inner engine's would not hold what sleeps.
  Capabilities capabilities() const noexcept override;
  using EngineShell::add;
  void add(const Body& body, const BodyState& state, Role role) override;
  void remove(BodyId id) override;
  bool contains(BodyId id) const noexcept override { return asleep(id) || inner_.contains(id); }
  BodyState state(BodyId id) const override { return asleep(id) ? things_[index(id)].anchor : inner_.state(id); }
  bool set_state(BodyId id, const BodyState& state) override;
  bool set_velocity(BodyId id, const Vec3& linear, const Vec3& angular) override;
  void set_inertia(BodyId id, double mass, const Vec3& inertia) override;
  bool apply_impulse(BodyId id, const Vec3& impulse, const Vec3& point) override;
  bool apply_force(BodyId id, const Vec3& force, const Vec3& torque) override;
  void step(double dt) override;
  Box bounds(BodyId id) const override { return asleep(id) ? things_[index(id)].bounds : inner_.bounds(id); }

  Checkpoint checkpoint() const override;
  void restore(const Checkpoint& checkpoint) override;

  static constexpr double kStillFor_s = 0.25;
  static constexpr double kDrift = 1e-3;  ///< of the thickness

 private:
  Engine& inner() const noexcept override { return inner_; }
  struct Thing {
    BodyState anchor;          ///< where it has been still, or sleeps
    Box bounds;                ///< there
    double still_s = 0.0;      ///< for so long it has been
    double unreached_s = 0.0;  ///< and nothing came near
    double thickness_m = 0.0;
    double drift_m = 0.0;      ///< that tells nothing
    double tolerance_m = 0.0;  ///< around the anchor, that counts as still
    double arm_m = 0.0;        ///< from the centre to the farthest point
    std::uint32_t next = 0;    ///< of those that sleep together: a ring
    std::uint32_t parent = 0;  ///< while islands are looked for
    bool restless = false;
    bool asleep = false;
    bool reached = false;
    bool in_hand = false;  ///< of roots: a restless body may reach one of those that hang together
  };
  /// A place that something may get to, from which it may push on.
  struct Reach {
    Box from;
    double travel_m = 0.0;
  };

  [[nodiscard]] std::uint32_t root(std::uint32_t i) noexcept;
  void join(std::uint32_t one, std::uint32_t other) noexcept;
  void watch(BodyId id, double dt);
  void reach_from(BodyId mover, double horizon_s);
  void wake(std::uint32_t one);
  /// Before somebody moves it: it must settle anew.
  void wake_before(BodyId id) {
    if (!asleep(id)) return;
    wake(index(id));
    settling_.re_engage(id);
  }
  void lay_asleep(std::uint32_t one);
  /// Of those that hang together by contacts.
  void find_islands();
  /// Which of them a hand may reach.
  void find_operators(double horizon_s);
  /// Which of them settle, and which fall asleep.
  void judge_islands();
  void sleep(std::uint32_t one);

  Engine& inner_;
  const Scene& scene_;
  bool rests_;
  double gravity_m_s2_;
  Settling settling_;
  std::vector<Thing> things_;  ///< by body
  BoxTree still_;              ///< still bodies, asleep or not
  std::vector<BodyId> awake_;
  std::vector<BodyId> waking_, woke_, slept_;
  std::vector<Reach> frontier_;
  std::vector<std::uint32_t> reached_;
  std::vector<BodyId> near_;
  std::vector<std::pair<std::uint32_t, BodyId>> islands_;  ///< root and body
  std::vector<BodyId> together_;
  double since_look_s_ = 0.0;
  bool islands_known_ = false;  ///< of the last step
  std::size_t asleep_count_ = 0;
};

}  // namespace subworld
