#include "haptic_sim/sub_world.hpp"

#include "coupling/plan.hpp"
#include "coupling/reduced/carried.hpp"
#include "coupling/synchroniser.hpp"
#include "model/reach.hpp"
#include "model/shape_extent.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace subworld {

namespace {

/// No operator moves a device faster: fast reaching movements come to 3 m/s, throws to more, but not with a device.
constexpr double kFastestOperator_m_s = 10.0;

constexpr std::uint64_t kNoStamp = ~std::uint64_t{0};  ///< of a report that was not made

}  // namespace

SubWorld::SubWorld(const Scene& scene, std::size_t user)
    : scene_(scene),
      user_(user),
      spec_(scene.users[user]),
      scheme_(scheme_of(scene.settings)),
      model_(make_local_model(scheme_, scene, user)),
      limits_(limits_of(spec_.device)),
      guard_(operator_limits_of(spec_.device), spec_.coupling.ramp_s),
      motion_(spec_.device.speed_limit_m_s, spec_.device.speed_limit_m_s / kTurnRadius_m),
      port_(scene, user),
      declutch_(scene.initial[index(spec_.proxy)]),
      tool_(tool_at(rate_, spec_, scene.body(spec_.proxy))),
      reports_device_(!enabled(scene, Optimisation::device)),
      sends_changes_(enabled(scene, Optimisation::changes)),
      omits_overruled_(enabled(scene, Optimisation::overruled, user)),
      may_suppress_(enabled(scene, Optimisation::suppression)),
      suppression_(scheme_.properties.lead_cycles),
      timetable_(scene.settings.ratio, remembered_cycles(scene.settings, scheme_)),
      reports_(remembered_cycles(scene.settings, scheme_)) {
  facts_.device = declutch_.device();
  look();
  if (scene.settings.mode != Mode::realtime) return;
  for (HapticReport& report : reports_) reserve(report, kUsualMembers);
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
  guard_.soften();
  look();
  return true;
}

void SubWorld::look() {
  const double h_s = scene_.settings.h_s;
  facts_.time_s = h_s * static_cast<double>(timetable_.start(facts_.stamp)) + in_cycle_s_;
  facts_.at_boundary = in_cycle_s_ >= cycle_s() - 1e-6 * h_s;
  facts_.cycle_left_s = facts_.at_boundary ? h_s * timetable_.ratio(facts_.stamp + 1) : cycle_s() - in_cycle_s_;
  facts_.proxy = model_->proxy();
  facts_.members = model_->members();
  facts_.contacts = model_->contacts();
  facts_.peers = model_->peers();
  const LiveEngine* engine = model_->engine();
  facts_.engine = engine == nullptr ? std::string_view() : engine->name();
}

FeltStep SubWorld::begin_step(const StepInput& input) {
  if (input.took_s > 0.0) {
    took_s_ += input.took_s;
    took_max_s_ = std::max(took_max_s_, input.took_s);
    ++timed_steps_;
  }
  if (input.slept || input.device_returned) guard_.restart();
  if (input.device_returned) {
    declutch_.place(declutch_.device().pose);
    heard_ = false;
  }
  declutch_.open(input.paused);
  set_rate(input.clock_rate);
  return input.device != nullptr ? feel(*input.device, input.device_trusted, input.wall_s) : FeltStep{};
}

void SubWorld::set_rate(double rate) {
  if (!(rate > 0.0)) return;
  const double before = std::exchange(rate_, std::max(rate, kLeastToolRate));
  if (rate_ == before) return;
  tool_ = tool_at(rate_, spec_, scene_.body(spec_.proxy));
  model_->change_rate(before, rate_);
  facts_.proxy = model_->proxy();
}

bool SubWorld::jumped(const DeviceState& state, double wall_s) const noexcept {
  if (!heard_) return false;
  const double passed_s = std::max({state.stamp_s - before_.stamp_s, wall_s, 1.0 / spec_.device.rate_hz});
  const double most_m = kFastestOperator_m_s * passed_s + 2.0 * spec_.device.position_resolution_m;
  return (state.pose.position - before_.pose.position).norm() > most_m ||
         state.linear_velocity.norm() > kFastestOperator_m_s;
}

FeltStep SubWorld::feel(const DeviceState& state, bool trusted, double wall_s) {
  const bool jump = jumped(state, wall_s);
  if (jump) {
    // Met where it is now, from zero.
    ++facts_.jumps;
    guard_.declutch();
  }
  const bool paused = declutch_.is_open();
  declutch_.open(paused || jump);
  declutch_.follow(state, rate_);
  declutch_.open(paused);
  facts_.device = declutch_.device();
  // A device that is slower than the haptic step sends no new state in each: its time goes on.
  if (!heard_ || state.stamp_s != before_.stamp_s) device_s_ = state.stamp_s;
  before_ = state;
  facts_.device_s = state.stamp_s;
  heard_ = true;
  wall_s_ = wall_s;
  applied_ = saturated(state.applied, limits_);
  const bool admittance = spec_.device.kind == DeviceKind::admittance;
  felt_ = admittance ? applied_ : coupling_wrench(tool_.coupling, limits_, facts_.proxy, facts_.device);
  trusted_ = trusted && facts_.finite && !declutch_.is_open();
  port_.share(model_->others_work_j());
  port_.step(state);
  const Wrench to_operator =
      guard_.pass({-felt_.force, -felt_.torque}, jump ? Vec3(Vec3::Zero()) : state.linear_velocity, trusted_, wall_s);
  port_.hold(to_operator);
  return {felt_, to_operator};
}

DeviceCommand SubWorld::command_for(const DeviceState& device, const Wrench& to_operator) {
  DeviceCommand command;
  command.device = device.device;
  command.session = device.session;
  command.served = device.sender;
  command.sequence = device.sequence;
  command.stamp_s = facts_.time_s;
  command.echoed_sent_ns = device.sent_ns;
  command.wrench = to_operator;
  command.others_work_j = model_->others_work_j();
  const BodyState& now = facts_.proxy;
  DeviceMotion motion{{now.position - declutch_.offset(), now.orientation * declutch_.turn().conjugate()},
                      rate_ * now.linear_velocity,
                      rate_ * now.angular_velocity};
  if (spec_.device.kind == DeviceKind::admittance) motion = motion_.pass(motion, trusted_, wall_s_);
  command.pose = motion.pose;
  command.linear_velocity = motion.linear_velocity;
  command.angular_velocity = motion.angular_velocity;
  return command;
}

void SubWorld::advance(double dt, std::span<const DeviceState* const> peers) {
  if (dt <= 0.0) return;
  const Wrench mean = model_->advance({spec_.device.kind, tool_, limits_, facts_.device, applied_, felt_, peers},
                                      facts_.time_s, dt, indicators_);
  in_cycle_s_ += dt;
  ++steps_;
  look();
  facts_.finite = facts_.finite && finite(facts_.proxy);
  impulse_total_.force += dt * mean.force;
  impulse_total_.torque += dt * mean.torque;
  indicators_.device_impulse_n_s += dt * mean.force.norm();
  // A spring's other end moves with the device; an admittance device presses the proxy itself.
  const bool spring = spec_.device.kind == DeviceKind::impedance;
  const Vec3& velocity = spring ? facts_.device.linear_velocity : facts_.proxy.linear_velocity;
  const Vec3& angular_velocity = spring ? facts_.device.angular_velocity : facts_.proxy.angular_velocity;
  facts_.device_work_j += dt * (mean.force.dot(velocity) + mean.torque.dot(angular_velocity));
  declutch_.advance(dt);  // extrapolated to the end of the step
  device_s_ += dt / rate_;
  facts_.device = declutch_.device();
}

bool SubWorld::suppresses_report() const {
  if (!may_suppress_ || !suppression_.may_lack_report(facts_.stamp + 1)) return false;
  const BodyState& now = facts_.proxy;
  const Box there = bounds(scene_.body(spec_.proxy).shape, now, scene_.meshes);
  return suppression_.place().holds(operator_reach(there, now, looked_ahead_s(scene_.settings, scheme_, cycle_s())));
}

void SubWorld::begin_cycle() {
  in_cycle_s_ = 0.0;
  indicators_ = {};
  steps_ = 0;
  look();
}

HapticReport* SubWorld::close_cycle(std::int64_t sent_ns) {
  if (!suppresses_report()) return &report(sent_ns);
  ++facts_.stamp;
  begin_cycle();
  return nullptr;
}

bool SubWorld::passes_frame(std::uint64_t stamp) noexcept {
  if (!suppression_.lacks_frame(stamp)) return false;
  frame_stamp_ = stamp;
  return true;
}

HapticReport& SubWorld::report(std::int64_t sent_ns) {
  if (steps_ > 0) ++facts_.stamp;
  suppression_.end(facts_.stamp);
  HapticReport& report = reports_[facts_.stamp % reports_.size()];
  report.user = UserId{static_cast<std::uint32_t>(user_)};
  report.stamp = facts_.stamp;
  report.stamp_s = scene_.settings.h_s * static_cast<double>(timetable_.start(facts_.stamp));
  report.clock_rate = rate_;
  report.sent_ns = sent_ns;
  report.confirmed_stamp = frame_stamp_;
  report.started_stamp = started_stamp_;
  report.impulse_total = impulse_total_;
  report.device_work_j = facts_.device_work_j;
  report.proxy = facts_.proxy;
  const bool spring = spec_.device.kind == DeviceKind::impedance;
  report.coupling_energy_j = spring ? coupling_energy(spec_.coupling, limits_, report.proxy, facts_.device) : 0.0;
  report.operator_work_j = port_.net_j();
  report.device.reset();
  const DevicePose& device = facts_.device;
  if (reports_device_) {
    report.device = {device.pose, device.linear_velocity, device.angular_velocity, applied_,
                     device_s_,   declutch_.offset(),     declutch_.turn()};
  }
  report.base_stamp.reset();
  if (sends_changes_) report.base_stamp = known_stamp_;
  report.omits_overruled = omits_overruled_;
  report.members.clear();
  report.islands.clear();
  report.indicators = indicators_;
  model_->describe(report);
  report.timing = {timed_steps_ > 0 ? took_s_ / timed_steps_ : 0.0, took_max_s_};
  took_s_ = took_max_s_ = 0.0;
  timed_steps_ = 0;
  begin_cycle();
  return report;
}

bool SubWorld::knows(const WorldFrame& frame) const noexcept {
  const auto in_scene = [&](BodyId id) { return index(id) < scene_.bodies.size(); };
  const auto possible = [&](const GhostModel& ghost) {
    if (!in_scene(ghost.outside)) return false;
    const Body& body = scene_.body(ghost.outside);
    return !body.fixed() && (!ghost.carried || holds(*ghost.carried, body));
  };
  return std::ranges::all_of(frame.members, in_scene) && std::ranges::all_of(frame.fixed, in_scene) &&
         std::ranges::all_of(frame.ghosts, possible) &&
         std::ranges::all_of(frame.ghost_peers, in_scene, &GhostPeer::proxy) &&
         std::ranges::all_of(frame.peers, in_scene, &PeerDevice::proxy) &&
         std::ranges::all_of(frame.entering, in_scene, [](const EnteringBody& e) { return e.body.id; });
}

void SubWorld::note(const WorldFrame& frame) noexcept {
  framed_ = true;
  frame_stamp_ = frame.stamp;
  if (frame.echoed_sent_ns != 0) known_stamp_ = frame.echoed_stamp;
  facts_.border_pairs = frame.border_contacts;
  if (may_suppress_) suppression_.begin(frame);
}

std::uint64_t SubWorld::synchronise_with(const WorldFrame& frame) {
  if (!knows(frame)) return 0;
  if (framed_ && frame.stamp <= frame_stamp_) return 0;
  const std::uint64_t missing = framed_ ? frame.stamp - frame_stamp_ - 1 : 0;
  if (frame.planned.stamp > facts_.stamp) timetable_.plan(frame.planned);
  const HapticReport& mine = reports_[frame.stamp % reports_.size()];
  const double cycles = static_cast<double>(facts_.stamp) - static_cast<double>(frame.stamp) + in_cycle_s_ / cycle_s();
  model_->follow(frame, framed_ && mine.stamp == frame.stamp ? &mine : nullptr,
                 {facts_.time_s - frame.stamp_s, cycles});
  note(frame);
  look();
  return missing;
}

bool SubWorld::agrees(const WorldFrame& frame) const noexcept {
  const double stamp_s = scene_.settings.h_s * static_cast<double>(timetable_.start(frame.stamp));
  const RatioChange& planned = frame.planned;
  return std::abs(stamp_s - frame.stamp_s) < 0.5 * scene_.settings.h_s &&
         (planned.stamp > facts_.stamp || timetable_.ratio(planned.stamp) == planned.ratio);
}

bool SubWorld::reset_from(const WorldFrame& frame) {
  if (!knows(frame)) return false;
  const bool first = !std::exchange(framed_, true);
  const BodyState before = facts_.proxy;
  known_stamp_.reset();
  for (HapticReport& said : reports_) said.stamp = kNoStamp;
  timetable_.restart(frame.stamp, static_cast<std::uint64_t>(std::llround(frame.stamp_s / scene_.settings.h_s)),
                     frame.ratio);
  timetable_.plan(frame.planned);
  const bool has_proxy = model_->reset_from(frame);
  facts_.stamp = started_stamp_ = frame.stamp;
  begin_cycle();
  suppression_.forget();
  note(frame);
  place_device(frame, first, before);
  facts_.finite = true;
  return has_proxy;
}

void SubWorld::place_device(const WorldFrame& frame, bool first, const BodyState& before) {
  const auto held = std::ranges::find(frame.peers, spec_.proxy, &PeerDevice::proxy);
  const Pose there = declutch_.device().pose;
  const BodyState& now = facts_.proxy;
  if (held != frame.peers.end()) {
    declutch_.place(held->pose);
  } else if (!facts_.finite) {
    declutch_.place({now.position, now.orientation});
  } else if (!first) {
    const Quat turn = now.orientation * before.orientation.conjugate();
    declutch_.place({now.position + (there.position - before.position), (turn * there.orientation).normalized()});
  }
  if (held != frame.peers.end() || !facts_.finite) {
    guard_.declutch();
  } else if (!first) {
    guard_.soften();
  }
  facts_.device = declutch_.device();
}

}  // namespace subworld
