#pragma once

#include "io/results/results.hpp"
#include "model/error.hpp"
#include "physics/shells/engine_exchange.hpp"
#include "rt/cyclic.hpp"
#include "wire/status.hpp"

#include <optional>
#include <string>

namespace subworld {

/// A planned order, as `subworld control` sends it.
[[nodiscard]] inline Control order_of(const PresenceEvent& event) {
  if (event.kind == PresenceEvent::Kind::stops) return {.verb = ControlVerb::stop, .argument = {}};
  if (event.kind == PresenceEvent::Kind::ratio) return {.verb = ControlVerb::set_ratio, .argument = event.order};
  return {.verb = ControlVerb::set_engine, .argument = (event.user == kWorld ? "world " : "haptic ") + event.order};
}

/// Throws `Error` (usage) where a planned order is refused.
inline void check_planned(const PresenceEvent& event, const OrderAnswer& answer) {
  if (answer.outcome == OrderState::refused)
    throw Error(ExitCode::usage, "presence: \"" + to_text(event) + "\": " + answer.text);
}

/// Between two steps of a `World` or `SubWorld`: replaces its engine if an ordered one is ready. Answers the order
/// where that fails; returns the exchange where it succeeds.
template <class Simulation>
std::optional<EngineChange> follow_exchange(Simulation& simulation, EngineExchange& exchange, StatusBeacon& status) {
  const std::string before(simulation.facts().engine);
  const TimePoint begin = Clock::now();
  if (simulation.exchange_engine(exchange)) {
    return EngineChange{exchange.order(), simulation.facts().time_s, before, std::string(simulation.facts().engine),
                        to_seconds(Clock::now() - begin)};
  }
  if (const std::string failure = exchange.take_failure(); !failure.empty()) {
    status.answer(exchange.order(), {OrderState::refused, failure});
  }
  return {};
}

}  // namespace subworld
