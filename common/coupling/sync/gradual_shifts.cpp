#include "coupling/sync/gradual_shifts.hpp"

#include "model/messages/exchange.hpp"

#include <algorithm>
#include <utility>

namespace subworld {

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
