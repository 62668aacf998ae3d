#include "haptic_sim/engine_orders.hpp"

#include <fmt/format.h>

namespace subworld {

void EngineOrders::follow() {
  while (ports_.control.take(order_) == Take::sample) {
    if (order_.verb != ControlVerb::set_engine) continue;
    const auto wanted = parse_engine_order(order_);
    if (!wanted || wanted->target != EngineOrder::Target::haptic) continue;
    ports_.status.answer(order_.number, sub_.change_engine(exchange_, *wanted));
  }
  const std::string before = sub_.engine_name();
  const TimePoint begin = Clock::now();
  if (sub_.exchange_engine(exchange_)) {
    measures_.engine_changed(
        {exchange_.order(), sub_.time_s(), before, sub_.engine_name(), to_seconds(Clock::now() - begin)});
  }
  if (const std::string failure = exchange_.take_failure(); !failure.empty()) {
    ports_.status.answer(exchange_.order(), "refused: " + failure);
  }
  if (const auto change = measures_.take_settled_change()) {
    ports_.status.answer(change->order, fmt::format("{}; force steps {:.3f} N, before {:.3f} N", to_text(*change),
                                                    change->force_step_n, change->force_step_before_n));
  }
}

}  // namespace subworld
