#include "world_sim/cycle.hpp"

#include "model/error.hpp"
#include "rt/stop.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace subworld {

namespace {

constexpr double kAcknowledged_s = 0.5;  ///< that the last frames may take to arrive, all users together

}  // namespace

void WorldCycle::follow_orders() {
  if (const std::string text = ports_.second_world(); !text.empty()) ports_.status.note(text);
  Control order;
  while (ports_.control.take(order) == Take::sample) {
    if (order.verb != ControlVerb::set_engine) {
      const std::string answer = control_.follow(order);
      ports_.status.pause(control_.paused());
      ports_.status.answer(order.number, answer);
      continue;
    }
    const auto wanted = parse_engine_order(order);
    if (wanted && wanted->target != EngineOrder::Target::world) continue;
    ports_.status.answer(order.number, wanted ? world_.change_engine(exchange_, *wanted)
                                              : "refused: unknown engine order \"" + order.argument + "\"");
  }
  exchange_engine();
}

void WorldCycle::exchange_engine() {
  const std::string before(world_.engine().name());
  const TimePoint begin = Clock::now();
  if (world_.exchange_engine(exchange_)) {
    const EngineChange change{exchange_.order(), world_.time_s(), before, std::string(world_.engine().name()),
                              to_seconds(Clock::now() - begin)};
    measures_.engine_changed(change);
    ports_.status.answer(change.order, to_text(change));
  }
  if (const std::string failure = exchange_.take_failure(); !failure.empty()) {
    ports_.status.answer(exchange_.order(), "refused: " + failure);
  }
}

void WorldCycle::step() {
  Stages<WorldStage>& stages = measures_.stages();
  world_.synchronise();
  stages.mark(WorldStage::synchronise);
  world_.simulate();
  stages.mark(WorldStage::simulate);
  world_.account();
  stages.mark(WorldStage::account);
  world_.make_frames();
  stages.mark(WorldStage::extract);
}

void WorldCycle::publish_frames(bool last, double start_in_s, double real_time_factor) {
  for (std::size_t u = 0; u < world_.user_count(); ++u) {
    if (!last && !world_.tells(u)) continue;
    WorldFrame& frame = world_.frame(u);
    frame.session = ports_.session;
    frame.served = ports_.served[u];
    frame.last = last;
    frame.start_in_s = start_in_s;
    frame.real_time_factor = real_time_factor;
    ports_.frames[u].write(frame);
  }
}

void WorldCycle::check_finite() const {
  if (world_.finite()) return;
  throw Error(ExitCode::failed,
              fmt::format("the world is no longer finite at t = {:.3f} s; use a smaller step or the preset quality",
                          world_.time_s()));
}

Ending WorldCycle::ending() const {
  return {.session = ports_.session,
          .to_s = world_.time_s(),
          .by = world_.over()        ? "duration"
                : control_.stopped() ? "control"
                                     : name_of_signal(stop_signal()),
          .fault = {}};
}

void WorldCycle::close() {
  world_.close();
  const TimePoint until = Clock::now() + from_seconds(kAcknowledged_s);
  for (auto& frames : ports_.frames) frames.wait_for_acknowledgments(std::max(0.0, to_seconds(until - Clock::now())));
}

}  // namespace subworld
