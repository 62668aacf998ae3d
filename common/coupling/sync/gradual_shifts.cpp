#include "coupling/sync/gradual_shifts.hpp"

#include "model/messages/exchange.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace subworld {

namespace {

/// Largest step of the coupling's force in which bodies are corrected. Smaller ones set more bodies in more steps,
/// which engines answer with work: Rapier's step takes up to a seventh longer.
constexpr double kUnfelt_n = 0.05;

}  // namespace

int unfelt_parts(std::span<const PairShift> pairs, const CouplingSettings& coupling, int most) noexcept {
  double felt_n = 0.0;
  for (const PairShift& pair : pairs) {
    felt_n = std::max({felt_n, coupling.stiffness_n_m * pair.sub.position.norm(),
                       coupling.damping_n_s_m * pair.sub.linear_velocity.norm()});
  }
  return static_cast<int>(std::clamp(std::ceil(felt_n / kUnfelt_n), 1.0, static_cast<double>(most)));
}

GradualShifts::GradualShifts() { pending_.reserve(4 * kUsualMembers); }

void GradualShifts::begin(Engine& engine, BodyId id, const BodyState& from, const Shift& shift, int parts) {
  const Shift part = parts == 1 ? shift : scaled(shift, 1.0 / parts);
  engine.set_state(id, shifted(from, part));
  if (parts > 1) pending_.push_back({id, part, parts - 1});
}

void GradualShifts::step(Engine& engine) {
  for (Pending& pending : pending_) {
    if (!std::exchange(pending.begun, true)) continue;
    engine.set_state(pending.id, shifted(engine.state(pending.id), pending.part));
    --pending.parts;
  }
  std::erase_if(pending_, [](const Pending& pending) { return pending.parts == 0; });
}

BodyState GradualShifts::completed(BodyId id, BodyState state) const {
  for (const Pending& pending : pending_) {
    if (pending.id == id) state = shifted(state, scaled(pending.part, pending.parts));
  }
  return state;
}

void GradualShifts::forget(BodyId id) {
  std::erase_if(pending_, [id](const Pending& pending) { return pending.id == id; });
}

}  // namespace subworld
