#include "program/engine_orders.hpp"
#include "haptic_sim/run.hpp"

#include <fmt/format.h>

namespace subworld {

void HapticRun::follow_orders() const {
  Control order;
  while (ports.control.take(order) == Take::sample) {
    if (order.verb != ControlVerb::set_engine) continue;
    const auto wanted = parse_engine_order(order);
    if (!wanted || wanted->target != EngineOrder::Target::haptic) continue;
    ports.status.answer(order.number, sub.change_engine(exchange, *wanted));
  }
  if (const auto change = follow_exchange(sub, exchange, ports.status)) measures.engine_changed(*change);
  if (const auto change = measures.take_settled_change()) {
    ports.status.answer(change->order, fmt::format("{}; force steps {:.3f} N, before {:.3f} N", to_text(*change),
                                                   change->force_step_n, change->force_step_before_n));
  }
}

}  // namespace subworld
