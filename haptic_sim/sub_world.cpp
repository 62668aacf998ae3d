#include "haptic_sim/sub_world.hpp"

#include "coupling/sync/synchroniser.hpp"

#include <utility>

namespace subworld {

SubWorld::SubWorld(const Scene& scene, std::size_t user)
    : scene_(scene),
      model_(make_local_model(scheme_of(scene.settings), scene, user)),
      device_(scene, user),
      link_(scene, scheme_of(scene.settings), user),
      clock_(scene.settings.h_s, scene.settings.ratio, remembered_cycles(scene.settings, scheme_of(scene.settings))) {
  look();
}

OrderAnswer SubWorld::change_engine(EngineExchange& exchange, const EngineOrder& order) {
  const LiveEngine* engine = model_->engine();
  if (engine == nullptr) return {OrderState::refused, "this scheme has no sub-world and so no engine in it"};
  EngineSettings settings = scene_.settings.haptic;
  settings.change_to(order.engine, order.preset);
  if (std::string text = exchange.refusal(settings); !text.empty()) return {OrderState::refused, std::move(text)};
  exchange.begin(settings, *engine, scene_.settings.h_s, order.number);
  return {OrderState::preparing, "preparing engine " + order.engine};
}

bool SubWorld::exchange_engine(EngineExchange& exchange) {
  LiveEngine* engine = model_->engine();
  if (engine == nullptr || !exchange.poll(*engine)) return false;
  device_.soften();
  look();
  return true;
}

void SubWorld::look() {
  facts_.stamp = clock_.stamp();
  facts_.time_s = clock_.time_s();
  facts_.proxy = model_->proxy();
  facts_.members = model_->members();
  facts_.contacts = model_->contacts();
  facts_.peers = model_->peers();
  const LiveEngine* engine = model_->engine();
  facts_.engine = engine == nullptr ? std::string_view() : engine->name();
}

FeltStep SubWorld::begin_step(const StepInput& input) {
  totals_.took(input.took_s);
  if (const auto before = device_.begin(input)) {
    model_->change_rate(*before, device_.rate());
    facts_.proxy = model_->proxy();
  }
  return device_.feel(input, facts_.proxy, facts_.finite, model_->others());
}

DeviceCommand SubWorld::command_for(const DeviceState& device, const Wrench& to_operator) {
  DeviceCommand command = device_.command_for(device, to_operator, facts_.proxy);
  command.stamp_s = facts_.time_s;
  command.others_work_j = model_->others().work_j;
  command.bodies_j = model_->others().bodies_j;
  return command;
}

void SubWorld::advance(double dt, std::span<const DeviceState* const> peers) {
  if (dt <= 0.0) return;
  const Wrench mean = model_->advance(device_.drive(peers), facts_.time_s, dt, totals_.indicators());
  clock_.advance(dt);
  totals_.add(mean, dt);
  facts_.device_work_j += device_.advance(mean, model_->proxy(), dt);
  look();
  facts_.finite = facts_.finite && finite(facts_.proxy);
}

HapticReport* SubWorld::close_cycle(std::int64_t sent_ns) {
  HapticReport* closed = nullptr;
  if (link_.suppresses(clock_.stamp() + 1, facts_.proxy, clock_.cycle_s())) {
    clock_.next();
  } else {
    closed = &report(sent_ns);
    clock_.begin();
  }
  totals_.begin_cycle();
  look();
  return closed;
}

HapticReport& SubWorld::report(std::int64_t sent_ns) {
  if (clock_.steps() > 0) clock_.next();
  HapticReport& report = link_.report(clock_.stamp());
  report.stamp_s = clock_.start_s(clock_.stamp());
  report.sent_ns = sent_ns;
  report.device_work_j = facts_.device_work_j;
  report.proxy = facts_.proxy;
  device_.describe(report);
  totals_.take(report);
  model_->describe(report);
  return report;
}

std::uint64_t SubWorld::synchronise_with(const WorldFrame& frame) {
  const auto missing = link_.missing_before(frame);
  if (!missing) return 0;
  clock_.plan(frame.planned);
  model_->follow(frame, link_.report_of(frame.stamp),
                 {facts_.time_s - frame.stamp_s, clock_.cycles_since(frame.stamp)});
  link_.use(frame);
  facts_.border_pairs = frame.border_contacts;
  look();
  return *missing;
}

bool SubWorld::reset_from(const WorldFrame& frame) {
  if (!link_.knows(frame)) return false;
  const BodyState before = facts_.proxy;
  const bool first = !link_.framed();
  clock_.restart(frame);
  link_.restart(frame);
  totals_.begin_cycle();
  const bool has_proxy = model_->reset_from(frame);
  device_.restart(frame, first ? nullptr : &before, model_->proxy(), facts_.finite);
  facts_.border_pairs = frame.border_contacts;
  facts_.finite = true;
  look();
  return has_proxy;
}

}  // namespace subworld
