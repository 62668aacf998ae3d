#pragma once

#include "model/scene/scene.hpp"
#include "physics/engine.hpp"

#include <span>
#include <vector>

namespace subworld {

/// Damps oscillating structures until they rest. Solvers hold a pile as if by springs with their own stiffness, with
/// next to no damping. A column of 25 cubes continues to oscillate, with `bullet` at `fast` more and more, and all
/// bodies that it touches stay awake.
///
/// Bodies that are connected by contacts *settle* while three conditions hold: for `kPatience_s` none of them has had
/// the energy to rise by `kLift` of its thickness; one is not still; and no operator may reach any of them. Then the
/// velocity of each body that *oscillates* is damped at the rate `kSettling_per_s`. It oscillates while it is no
/// farther from the point at which it last turned back than `kGrowth` of the way between its last two such points. So a
/// body that only goes on, as one that begins to slide or to fall over, is not damped. Gliding, rolling, floating and
/// flying bodies never are: bodies without weight, friction or contacts, and round ones. A body that leaves its place
/// by `kPlace` must be calm for twice as long from then on.
///
/// A body that has settled for `kSettledFor_s` is moved by the solver only. It counts as still while it stays within
/// `kTremble` of one place, and also while it creeps from one such place to the next in no less than `kCreep_s`: in a
/// pile of thousands, some body always trembles or creeps.
class Settling {
 public:
  /// With `asked` false nothing settles. `scene` must outlive this object.
  Settling(const Scene& scene, bool asked);

  /// `arm_m`: distance from the centre to the farthest point. `may`: false for a body that never settles.
  void add(const Body& body, double thickness_m, double arm_m, bool may);
  /// Call after each step: updates how long the body has been calm, and whether it has left its place. `speed_m_s`: of
  /// its fastest point.
  void watch(BodyId id, const BodyState& now, double speed_m_s, double dt);
  /// A body that is moved from outside settles again.
  void restart(BodyId id);
  /// A body that wakes is not damped before the next judge().
  void wakes(BodyId id) { things_[index(id)].settles = false; }
  void sleeps(BodyId id) { things_[index(id)].patience_s = kPatience_s; }

  /// Call before touches(), once a step.
  void begin_contacts(std::span<const BodyId> awake);
  void touches(const Contact& contact);
  /// Decides for one island. `sways`: one body is not still. `in_reach`: an operator may reach one.
  void judge(std::span<const BodyId> together, bool sways, bool in_reach, const Engine& engine);
  void damp(std::span<const BodyId> awake, Engine& engine, double dt) const;

  /// Whether the body has settled for so long that only the solver moves it.
  [[nodiscard]] bool has_settled(BodyId id) const noexcept { return things_[index(id)].settled_s >= kSettledFor_s; }

  static constexpr double kPatience_s = 0.25;
  static constexpr double kLift = 0.01;  ///< of the thickness
  static constexpr double kPlace = 0.3;  ///< of the thickness
  static constexpr double kGrowth = 1.2;
  static constexpr double kTurned = 0.9;  ///< part of the way from the last turn below which a body has turned back
  /// Damping rate of velocities: critical for an oscillation of 3 s; with 16, creep lasts longer.
  static constexpr double kSettling_per_s = 4.0;
  static constexpr double kSettledFor_s = 5.0;
  static constexpr double kTremble = 0.02;  ///< of the thickness
  static constexpr double kCreep_s = 2.0;

 private:
  struct Thing {
    double arm_m = 0.0;
    double place_m = 0.0;   ///< largest motion that does not count as leaving its place
    double calm_m_s = 0.0;  ///< the speed that lifts it by `kLift`
    double calm_s = 0.0;    ///< time for which it has been slower
    double patience_s = kPatience_s;
    double settled_s = 0.0;
    BodyState place;     ///< place at which it began to settle
    BodyState turn;      ///< place at which it last turned back
    BodyState farthest;  ///< from the turn, since
    double farthest_m = 0.0;
    double between_turns_m = 0.0;  ///< way between the last two turns
    bool oscillates = false;
    bool touches = false;
    bool slips = false;    ///< has a contact without friction
    bool settles = false;  ///< with all bodies of its island
    bool is_damped = false;

    [[nodiscard]] bool is_calm() const noexcept { return calm_s >= patience_s && touches && !slips; }
  };
  static void follow_turns(Thing& thing, const BodyState& now);

  const Scene& scene_;
  bool asked_;
  double gravity_m_s2_;
  std::vector<Thing> things_;  ///< by body
};

/// The largest distance that any point of a body moves between two states, m. `arm_m`: from its centre to the farthest
/// point.
[[nodiscard]] double moved_m(const BodyState& from, const BodyState& to, double arm_m);

}  // namespace subworld
