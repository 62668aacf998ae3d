#pragma once

#include "coupling/sync/blend.hpp"
#include "coupling/sync/synchroniser.hpp"
#include "physics/engine.hpp"

#include <span>
#include <vector>

namespace subworld {

/// The least number of equal shares with which no correction lets the coupling's force jump so that it is felt, at most
/// `most`. It is the same for all bodies: those that touch move together.
[[nodiscard]] int unfelt_parts(std::span<const PairShift> pairs, const CouplingSettings& coupling, int most) noexcept;

/// Corrections of a sub-world's bodies, made in equal parts: one now and one before each further step of the engine.
/// Two engines that let bodies overlap by unequal amounts never agree; made at once, their difference would jolt the
/// force in every cycle.
class GradualShifts {
 public:
  GradualShifts();

  /// Shifts a body that is in the engine, from its state or from another one.
  void begin(Engine& engine, BodyId id, const BodyState& from, const Shift& shift, int parts);
  /// Before each step of the engine.
  void step(Engine& engine);

  /// A body's state as it will be when all its shifts are done.
  [[nodiscard]] BodyState completed(BodyId id, BodyState state) const;

  void forget(BodyId id);
  void clear() noexcept { pending_.clear(); }

 private:
  struct Pending {
    BodyId id{};
    Shift part;
    int parts = 0;       ///< to come
    bool begun = false;  ///< the step of the first part is over
  };

  std::vector<Pending> pending_;
};

}  // namespace subworld
