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
      port_(spec_),
      declutch_(scene.initial[index(spec_.proxy)]),
      tool_(tool_at(rate_, spec_, scene.body(spec_.proxy))),
      reports_device_(!enabled(scene, Optimisation::device)),
      may_suppress_(enabled(scene, Optimisation::suppression)),
      suppression_(scheme_.properties.lead_cycles),
      timetable_(scene.settings.ratio, remembered_cycles(scene.settings, scheme_)),
      reports_(remembered_cycles(scene.settings, scheme_)) {
  if (scene.settings.mode != Mode::realtime) return;
  for (HapticReport& report : reports_) reserve(report, kUsualMembers);
}

std::string SubWorld::change_engine(EngineExchange& exchange, const EngineOrder& order) {
  const LiveEngine* engine = model_->engine();
  if (engine == nullptr) return "refused: this scheme has no sub-world and so no engine in it";
  EngineSettings settings = scene_.settings.haptic;
  settings.change_to(order.engine, order.preset);
  const bool begun = exchange.begin(settings, *engine, scene_.settings.h_s, order.number);
  return begun ? "preparing engine " + order.engine : "refused: another change of engine is under way; try again";
}

bool SubWorld::exchange_engine(EngineExchange& exchange) {
  LiveEngine* engine = model_->engine();
  if (engine == nullptr || !exchange.poll(*engine)) return false;
  guard_.soften();
  return true;
}

std::string SubWorld::engine_name() const {
  const LiveEngine* engine = model_->engine();
  return engine == nullptr ? std::string() : std::string(engine->name());
}

double SubWorld::time_s() const noexcept {
  return scene_.settings.h_s * static_cast<double>(timetable_.start(stamp_)) + in_cycle_s_;
}

double SubWorld::cycle_left_s() const noexcept {
  return at_boundary() ? scene_.settings.h_s * timetable_.ratio(stamp_ + 1) : cycle_s() - in_cycle_s_;
}

bool SubWorld::at_boundary() const noexcept { return in_cycle_s_ >= cycle_s() - 1e-6 * scene_.settings.h_s; }

void SubWorld::set_rate(double rate) {
  if (!(rate > 0.0)) return;
  const double before = std::exchange(rate_, std::max(rate, kLeastToolRate));
  if (rate_ == before) return;
  tool_ = tool_at(rate_, spec_, scene_.body(spec_.proxy));
  model_->change_rate(before, rate_);
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
    ++jumps_;
    guard_.declutch();
  }
  const bool stands = declutch_.is_open();
  declutch_.open(stands || jump);
  declutch_.follow(state, rate_);
  declutch_.open(stands);
  before_ = state;
  heard_ = true;
  wall_s_ = wall_s;
  applied_ = saturated(state.applied, limits_);
  const bool admittance = spec_.device.kind == DeviceKind::admittance;
  felt_ = admittance ? applied_ : coupling_wrench(tool_.coupling, limits_, proxy(), device());
  trusted_ = trusted && finite_ && !declutch_.is_open();
  port_.step(state);
  const Wrench to_operator =
      guard_.pass({-felt_.force, -felt_.torque}, jump ? Vec3(Vec3::Zero()) : state.linear_velocity, trusted_, wall_s);
  port_.hold(to_operator);
  felt_now_ = true;
  return {felt_, to_operator};
}

DeviceCommand SubWorld::command_for(const DeviceState& device, const Wrench& to_operator) {
  DeviceCommand command;
  command.device = device.device;
  command.session = device.session;
  command.served = device.sender;
  command.sequence = device.sequence;
  command.stamp_s = time_s();
  command.echoed_sent_ns = device.sent_ns;
  command.wrench = to_operator;
  const BodyState now = proxy();
  const BodyState& start = scene_.initial[index(spec_.proxy)];
  DeviceMotion motion{{now.position - declutch_.offset(), now.orientation * start.orientation.conjugate()},
                      rate_ * now.linear_velocity,
                      rate_ * now.angular_velocity};
  if (spec_.device.kind == DeviceKind::admittance) motion = motion_.pass(motion, trusted_, wall_s_);
  command.pose = motion.pose;
  command.linear_velocity = motion.linear_velocity;
  command.angular_velocity = motion.angular_velocity;
  return command;
}

void SubWorld::advance(double dt) {
  felt_now_ = false;
  if (dt <= 0.0) return;
  const Wrench mean =
      model_->advance({spec_.device.kind, tool_, limits_, device(), applied_, felt_}, time_s(), dt, indicators_);
  const BodyState moved = proxy();
  finite_ = finite_ && subworld::finite(moved);
  impulse_total_.force += dt * mean.force;
  impulse_total_.torque += dt * mean.torque;
  indicators_.device_impulse_n_s += dt * mean.force.norm();
  // A spring's other end moves with the device; an admittance device presses the proxy itself.
  const bool spring = spec_.device.kind == DeviceKind::impedance;
  device_work_j_ += dt * (mean.force.dot(spring ? device().linear_velocity : moved.linear_velocity) +
                          mean.torque.dot(spring ? device().angular_velocity : moved.angular_velocity));
  declutch_.advance(dt);  // extrapolated to the end of the step
  in_cycle_s_ += dt;
  ++steps_;
}

bool SubWorld::suppresses_report() const {
  if (!may_suppress_ || !suppression_.may_lack_report(stamp_ + 1)) return false;
  const BodyState now = proxy();
  const Box there = bounds(scene_.body(spec_.proxy).shape, now, scene_.meshes);
  return suppression_.place().holds(operator_reach(there, now, looked_ahead_s(scene_.settings, scheme_, cycle_s())));
}

void SubWorld::begin_cycle() {
  indicators_ = {};
  steps_ = 0;
}

HapticReport* SubWorld::close_cycle(std::int64_t sent_ns) {
  if (!suppresses_report()) return &report(sent_ns);
  ++stamp_;
  in_cycle_s_ = 0.0;
  begin_cycle();
  return nullptr;
}

bool SubWorld::passes_frame(std::uint64_t stamp) noexcept {
  if (!suppression_.lacks_frame(stamp)) return false;
  frame_stamp_ = stamp;
  return true;
}

HapticReport& SubWorld::report(std::int64_t sent_ns) {
  if (steps_ > 0) ++stamp_;
  in_cycle_s_ = 0.0;
  suppression_.end(stamp_);
  HapticReport& report = reports_[stamp_ % reports_.size()];
  report.user = UserId{static_cast<std::uint32_t>(user_)};
  report.stamp = stamp_;
  report.stamp_s = time_s();
  report.clock_rate = rate_;
  report.sent_ns = sent_ns;
  report.confirmed_stamp = frame_stamp_;
  report.impulse_total = impulse_total_;
  report.device_work_j = device_work_j_;
  report.proxy = proxy();
  const bool spring = spec_.device.kind == DeviceKind::impedance;
  report.coupling_energy_j = spring ? coupling_energy(spec_.coupling, limits_, report.proxy, device()) : 0.0;
  report.device.reset();
  if (reports_device_) {
    report.device = {device().pose, device().linear_velocity, device().angular_velocity, applied_};
  }
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
         std::ranges::all_of(frame.peers, in_scene, &PeerDevice::proxy) &&
         std::ranges::all_of(frame.entering, in_scene, [](const EnteringBody& e) { return e.body.id; });
}

void SubWorld::note(const WorldFrame& frame) noexcept {
  framed_ = true;
  frame_stamp_ = frame.stamp;
  border_pairs_ = frame.border_contacts;
  if (may_suppress_) suppression_.begin(frame);
}

std::uint64_t SubWorld::synchronise_with(const WorldFrame& frame) {
  if (!knows(frame)) return 0;
  if (framed_ && frame.stamp <= frame_stamp_) return 0;
  const std::uint64_t missing = framed_ ? frame.stamp - frame_stamp_ - 1 : 0;
  if (frame.planned.stamp > stamp_) timetable_.plan(frame.planned);
  const HapticReport& mine = reports_[frame.stamp % reports_.size()];
  const double cycles = static_cast<double>(stamp_) - static_cast<double>(frame.stamp) + in_cycle_s_ / cycle_s();
  model_->follow(frame, framed_ && mine.stamp == frame.stamp ? &mine : nullptr, {time_s() - frame.stamp_s, cycles});
  note(frame);
  return missing;
}

bool SubWorld::agrees(const WorldFrame& frame) const noexcept {
  const double stamp_s = scene_.settings.h_s * static_cast<double>(timetable_.start(frame.stamp));
  const RatioChange& planned = frame.planned;
  return std::abs(stamp_s - frame.stamp_s) < 0.5 * scene_.settings.h_s &&
         (planned.stamp > stamp_ || timetable_.ratio(planned.stamp) == planned.ratio);
}

bool SubWorld::reset_from(const WorldFrame& frame) {
  if (!knows(frame)) return false;
  timetable_.restart(frame.stamp, static_cast<std::uint64_t>(std::llround(frame.stamp_s / scene_.settings.h_s)),
                     frame.ratio);
  timetable_.plan(frame.planned);
  const bool has_proxy = model_->reset_from(frame);
  finite_ = true;
  stamp_ = frame.stamp;
  in_cycle_s_ = 0.0;
  begin_cycle();
  suppression_.forget();
  felt_now_ = false;
  note(frame);
  return has_proxy;
}

}  // namespace subworld
