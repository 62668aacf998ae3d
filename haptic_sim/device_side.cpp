#include "haptic_sim/device_side.hpp"

#include <algorithm>

namespace subworld {

namespace {

/// No operator moves a device faster: fast reaching movements come to 3 m/s, throws to more, but not with a device.
constexpr double kFastestOperator_m_s = 10.0;

}  // namespace

DeviceSide::DeviceSide(const Scene& scene, std::size_t user)
    : spec_(scene.users[user]),
      limits_(limits_of(spec_.device)),
      guard_(operator_limits_of(spec_.device), spec_.coupling.ramp_s),
      motion_(spec_.device.speed_limit_m_s, spec_.device.speed_limit_m_s / kTurnRadius_m),
      port_(scene, user),
      tool_(spec_, scene.body(spec_.proxy)),
      declutch_(scene.initial[index(spec_.proxy)]) {}

std::optional<double> DeviceSide::begin(const StepInput& input) noexcept {
  if (input.slept || input.device_returned) guard_.restart();
  if (input.device_returned) {
    declutch_.place(declutch_.device().pose);
    heard_ = false;
  }
  declutch_.open(input.paused);
  return input.clock_rate > 0.0 ? tool_.change(input.clock_rate) : std::nullopt;
}

bool DeviceSide::jumped(const DeviceState& state, double wall_s) const noexcept {
  if (!heard_) return false;
  const double passed_s = std::max({state.stamp_s - before_.stamp_s, wall_s, 1.0 / spec_.device.rate_hz});
  const double most_m = kFastestOperator_m_s * passed_s + 2.0 * spec_.device.position_resolution_m;
  return (state.pose.position - before_.pose.position).norm() > most_m ||
         state.linear_velocity.norm() > kFastestOperator_m_s;
}

FeltStep DeviceSide::feel(const StepInput& input, const BodyState& proxy, bool sound, const OthersEnergy& others) {
  if (input.device == nullptr) return {};
  const DeviceState& state = *input.device;
  const bool jump = jumped(state, input.wall_s);
  if (jump) {
    // Met where it is now, from zero.
    ++jumps_;
    guard_.declutch();
  }
  declutch_.open(input.paused || jump);
  declutch_.follow(state, tool_.rate());
  declutch_.open(input.paused);
  // A device that is slower than the haptic step sends no new state in each: its time goes on.
  if (!heard_ || state.stamp_s != before_.stamp_s) device_s_ = state.stamp_s;
  before_ = state;
  heard_ = true;
  wall_s_ = input.wall_s;
  applied_ = saturated(state.applied, limits_);
  felt_ = spring() ? coupling_wrench(tool_.at_rate().coupling, limits_, proxy, declutch_.device()) : applied_;
  trusted_ = input.device_trusted && sound && !input.paused;
  port_.share(others);
  port_.step(state);
  const Wrench to_operator =
      guard_.pass({-felt_.force, -felt_.torque}, jump ? Vec3(Vec3::Zero()) : state.linear_velocity, trusted_, wall_s_);
  port_.hold(to_operator);
  return {felt_, to_operator};
}

Drive DeviceSide::drive(std::span<const DeviceState* const> peers) const noexcept {
  return {spec_.device.kind, tool_.at_rate(), limits_, declutch_.device(), applied_, felt_, peers};
}

double DeviceSide::advance(const Wrench& mean, const BodyState& proxy, double dt) noexcept {
  const DevicePose& device = declutch_.device();
  const Vec3& velocity = spring() ? device.linear_velocity : proxy.linear_velocity;
  const Vec3& angular_velocity = spring() ? device.angular_velocity : proxy.angular_velocity;
  const double work_j = dt * (mean.force.dot(velocity) + mean.torque.dot(angular_velocity));
  declutch_.advance(dt);  // extrapolated to the end of the step
  device_s_ += dt / tool_.rate();
  return work_j;
}

void DeviceSide::restart(const WorldFrame& frame, const BodyState* before, const BodyState& proxy,
                         bool sound) noexcept {
  const auto held = std::ranges::find(frame.peers, spec_.proxy, &PeerDevice::proxy);
  const Pose there = declutch_.device().pose;
  if (held != frame.peers.end()) {
    declutch_.place(held->pose);
  } else if (!sound) {
    declutch_.place({proxy.position, proxy.orientation});
  } else if (before != nullptr) {
    const Quat turn = proxy.orientation * before->orientation.conjugate();
    declutch_.place({proxy.position + (there.position - before->position), (turn * there.orientation).normalized()});
  }
  if (held != frame.peers.end() || !sound) {
    guard_.declutch();
  } else if (before != nullptr) {
    guard_.soften();
  }
}

DeviceCommand DeviceSide::command_for(const DeviceState& device, const Wrench& to_operator, const BodyState& proxy) {
  DeviceCommand command;
  command.device = device.device;
  command.session = device.session;
  command.served = device.sender;
  command.sequence = device.sequence;
  command.echoed_sent_ns = device.sent_ns;
  command.wrench = to_operator;
  const double rate = tool_.rate();
  DeviceMotion motion{{proxy.position - declutch_.offset(), proxy.orientation * declutch_.turn().conjugate()},
                      rate * proxy.linear_velocity,
                      rate * proxy.angular_velocity};
  if (!spring()) motion = motion_.pass(motion, trusted_, wall_s_);
  command.pose = motion.pose;
  command.linear_velocity = motion.linear_velocity;
  command.angular_velocity = motion.angular_velocity;
  return command;
}

void DeviceSide::describe(HapticReport& report) const {
  const DevicePose& device = declutch_.device();
  report.clock_rate = tool_.rate();
  report.coupling_energy_j = spring() ? coupling_energy(spec_.coupling, limits_, report.proxy, device) : 0.0;
  report.operator_work_j = port_.net_j();
  if (report.device) {
    *report.device = {device.pose, device.linear_velocity, device.angular_velocity, applied_,
                      device_s_,   declutch_.offset(),     declutch_.turn()};
  }
}

}  // namespace subworld
