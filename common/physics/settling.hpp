#pragma once

#include "model/scene.hpp"
#include "physics/engine.hpp"

#include <span>
#include <vector>

namespace subworld {

/// Brings to rest what sways. Solvers hold a pile as springs of their own stiffness would, which lose next to nothing:
/// a column of 25 cubes sways on, with `bullet` at `fast` more and more, and keeps all that it touches awake.
///
/// Bodies that hang together by contacts *settle* while none of them has had the energy to rise by `kLift` of its
/// thickness for `kPatience_s`, one is not still, and no hand may reach any of them: their velocities are damped then
/// at the rate `kSettling_per_s`. Never damped is what glides, rolls, floats or flies: bodies without weight or
/// friction, round ones, and what falls, which is soon too fast. What begins to slide leaves its place by `kPlace`; it
/// must be calm for twice as long from then on, and so gets away.
///
/// What has settled for `kSettledFor_s` is moved by the solver alone. It counts as still while it stays within
/// `kTremble` of one place, and also while it creeps from one such place to the next in no less than `kCreep_s`: in a
/// pile of thousands, one or the other is always on its way.
class Settling {
 public:
  /// With `asked` false nothing settles. `scene` must outlive this object.
  Settling(const Scene& scene, bool asked);

  /// `arm_m`: from the centre to the farthest point. `may`: a body that never settles is told with false.
  void add(const Body& body, double thickness_m, double arm_m, bool may);
  /// After each step: how calm it is, and whether it has left its place. `speed_m_s`: of its fastest point.
  void watch(BodyId id, const BodyState& now, double speed_m_s, double dt);
  /// Who is moved by somebody settles anew.
  void re_engage(BodyId id);
  /// Who wakes is not damped before it has been looked at.
  void wakes(BodyId id) { things_[index(id)].settles = false; }
  void sleeps(BodyId id) { things_[index(id)].patience_s = kPatience_s; }

  /// Before the contacts of a step are told.
  void begin_contacts(std::span<const BodyId> awake);
  void touches(const Contact& contact);
  /// Judges those that hang together. `sways`: one of them is not still. `in_hand`: a hand may reach one of them.
  void judge(std::span<const BodyId> together, bool sways, bool in_hand, const Engine& engine);
  void damp(std::span<const BodyId> awake, Engine& engine, double dt) const;

  /// Whether it has settled for so long that only the solver moves it.
  [[nodiscard]] bool has_settled(BodyId id) const noexcept { return things_[index(id)].settled_s >= kSettledFor_s; }

  static constexpr double kPatience_s = 0.25;
  static constexpr double kLift = 0.01;           ///< of the thickness
  static constexpr double kPlace = 0.3;           ///< of the thickness
  static constexpr double kSettling_per_s = 4.0;  ///< of velocities: critical for a sway of 3 s; 16 makes creep last
  static constexpr double kSettledFor_s = 5.0;
  static constexpr double kTremble = 0.02;  ///< of the thickness
  static constexpr double kCreep_s = 2.0;

 private:
  struct Thing {
    double arm_m = 0.0;
    double place_m = 0.0;   ///< that it may move and not have left its place
    double calm_m_s = 0.0;  ///< the speed that lifts it by `kLift`
    double calm_s = 0.0;    ///< for so long it has been slower
    double patience_s = kPatience_s;
    double settled_s = 0.0;
    BodyState place;       ///< where it began to settle
    bool slips = false;    ///< has a contact without friction
    bool settles = false;  ///< as all that it hangs together with
    bool is_damped = false;

    [[nodiscard]] bool is_calm() const noexcept { return calm_s >= patience_s && !slips; }
  };

  const Scene& scene_;
  bool asked_;
  double gravity_m_s2_;
  std::vector<Thing> things_;  ///< by body
};

/// The farthest that any point of a body moves between two states, m. `arm_m`: from its centre to the farthest point.
[[nodiscard]] double moved_m(const BodyState& from, const BodyState& to, double arm_m);

}  // namespace subworld
