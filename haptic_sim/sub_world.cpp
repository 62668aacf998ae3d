#include "haptic_sim/sub_world.hpp"

#include "coupling/selection.hpp"
#include "model/error.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace subworld {

namespace {

std::vector<BodyId> peers_of(const Scene& scene, std::size_t user) {
  std::vector<BodyId> peers;
  for (std::size_t u = 0; u < static_cast<std::size_t>(scene.settings.users); ++u) {
    if (u != user) peers.push_back(scene.users[u].proxy);
  }
  return peers;
}

}  // namespace

SubWorld::SubWorld(const Scene& scene, std::size_t user)
    : scene_(scene),
      user_(user),
      spec_(scene.users[user]),
      scheme_(make_scheme(scene.settings)),
      synchroniser_(*scheme_, remembered_cycles(scene.settings, *scheme_), spec_.proxy, peers_of(scene, user)),
      limits_(limits_of(spec_.device)),
      guard_(limits_, spec_.coupling.ramp_s),
      world_proxy_(scene.initial[index(spec_.proxy)]),
      ghosts_(scene, remembered_cycles(scene.settings, *scheme_)),
      reports_(remembered_cycles(scene.settings, *scheme_)) {
  reserve(frame_, kUsualMembers);
  for (HapticReport& report : reports_) reserve(report, kUsualMembers);
  members_.reserve(kUsualMembers);
  fixed_.reserve(kUsualMembers);
  scratch_.reserve(kUsualMembers);
  border_impulses_.reserve(4 * kUsualMembers);
  device_.pose = {world_proxy_.position, world_proxy_.orientation};
  if (scheme_->has_sub_world()) {
    engine_ = std::make_unique<LiveEngine>(make_engine(scene.settings.haptic, scene.meshes));
  }
}

std::string SubWorld::change_engine(EngineExchange& exchange, const EngineOrder& order) {
  if (!engine_) return "refused: this scheme has no sub-world and so no engine in it";
  EngineSettings settings = scene_.settings.haptic;
  if (order.engine != settings.name) settings.iterations = settings.substeps = std::nullopt;  // meant for that one
  settings.name = order.engine;
  settings.preset = order.preset;
  const bool begun = exchange.begin(settings, *engine_, scene_.settings.h_s, order.number);
  return begun ? "preparing engine " + order.engine : "refused: another change of engine is under way; try again";
}

bool SubWorld::exchange_engine(EngineExchange& exchange) {
  if (!engine_ || !exchange.poll(*engine_)) return false;
  guard_.soften();
  return true;
}

void SubWorld::place_device(const DeviceState& d) {
  const BodyState& start = scene_.initial[index(spec_.proxy)];
  if (!clutched_) {
    // Wherever a device is when it is first heard, that place is the proxy's start.
    clutch_ = start.position - d.pose.position;
    clutched_ = true;
  } else if (stands_) {
    clutch_ = device_.pose.position - d.pose.position;
  }
  device_.pose.position = d.pose.position + clutch_;
  device_.pose.orientation = d.pose.orientation * start.orientation;
  device_.linear_velocity = stands_ ? Vec3::Zero() : d.linear_velocity;
  device_.angular_velocity = stands_ ? Vec3::Zero() : d.angular_velocity;
  applied_ = saturated(d.applied, limits_);
}

BodyState SubWorld::proxy() const { return engine_ ? engine_->state(spec_.proxy) : world_proxy_; }

std::size_t SubWorld::contacts() const noexcept { return engine_ ? engine_->contacts().size() : 0; }

double SubWorld::time_s() const noexcept {
  return static_cast<double>(stamp_) * scene_.settings.cycle_s() + in_cycle_s_;
}

double SubWorld::cycle_left_s() const noexcept {
  return scene_.settings.cycle_s() - (at_boundary() ? 0.0 : in_cycle_s_);
}

bool SubWorld::at_boundary() const noexcept {
  return in_cycle_s_ >= scene_.settings.cycle_s() - 1e-6 * scene_.settings.h_s;
}

FeltStep SubWorld::feel(const DeviceState& state, bool trusted, double dt) {
  place_device(state);
  const bool admittance = spec_.device.kind == DeviceKind::admittance;
  felt_ = admittance ? applied_ : coupling_wrench(spec_.coupling, limits_, proxy(), device_);
  const Wrench safe = guard_.pass(felt_, trusted && finite_ && !stands_, dt);
  return {felt_, {-safe.force, -safe.torque}};
}

void SubWorld::advance(double dt) {
  if (dt <= 0.0) return;
  Wrench mean = felt_;
  if (engine_) {
    const double cycle_s = scene_.settings.cycle_s();
    if (dt != border_impulses_for_s_) {
      scheme_->border_impulses(frame_, dt / cycle_s, border_impulses_);
      border_impulses_for_s_ = dt;
    }
    for (const PointImpulse& i : border_impulses_) {
      if (engine_->contains(i.body)) engine_->apply_impulse(i.body, i.impulse, i.point);
    }
    ghosts_.begin(*engine_, dt);
    move_peers(dt);
    const Body& body = scene_.body(spec_.proxy);
    if (spec_.device.kind == DeviceKind::admittance) {
      engine_->apply_force(spec_.proxy, applied_.force, applied_.torque);
      engine_->step(dt);
    } else {
      const ImplicitStep coupling =
          implicit_step(spec_.coupling, limits_, body, engine_->state(spec_.proxy), device_, dt);
      hold(spec_.proxy, coupling);
      engine_->step(dt);
      mean = exerted(spec_.coupling, limits_, coupling, engine_->state(spec_.proxy), dt);
    }
    ghosts_.end(*engine_, dt);
    observe_contacts();
    finite_ = finite_ && subworld::finite(engine_->state(spec_.proxy));
  }
  impulse_.force += dt * mean.force;
  impulse_.torque += dt * mean.torque;
  indicators_.device_impulse_n_s += dt * mean.force.norm();
  // A spring's other end moves with the device; an admittance device presses the proxy itself.
  const bool spring = spec_.device.kind == DeviceKind::impedance;
  const BodyState moved = proxy();
  device_work_j_ += dt * (mean.force.dot(spring ? device_.linear_velocity : moved.linear_velocity) +
                          mean.torque.dot(spring ? device_.angular_velocity : moved.angular_velocity));
  device_.pose.position += dt * device_.linear_velocity;  // where the hand is when the step ends, as far as is known
  in_cycle_s_ += dt;
  ++steps_;
}

void SubWorld::hold(BodyId proxy, const ImplicitStep& coupling) {
  engine_->set_inertia(proxy, coupling.mass, coupling.inertia);
  engine_->set_velocity(proxy, coupling.start.linear_velocity, coupling.start.angular_velocity);
  engine_->apply_force(proxy, coupling.wrench.force, coupling.wrench.torque);
}

void SubWorld::move_peers(double dt) {
  // By their devices, not by their forces: a force that is late drops what it holds.
  for (const PeerDevice& peer : frame_.peers) {
    const auto user = std::ranges::find(scene_.users, peer.proxy, &UserSpec::proxy);
    if (user == scene_.users.end() || !engine_->contains(peer.proxy)) continue;
    DevicePose device{peer.pose, peer.linear_velocity, peer.angular_velocity};
    device.pose.position += (time_s() - frame_.stamp_s) * device.linear_velocity;
    hold(peer.proxy, implicit_step(user->coupling, limits_of(user->device), scene_.body(peer.proxy),
                                   engine_->state(peer.proxy), device, dt));
  }
}

FeltStep SubWorld::step(const DeviceState& device, bool trusted, double dt) {
  const FeltStep felt = feel(device, trusted, dt);
  advance(dt);
  return felt;
}

void SubWorld::observe_contacts() {
  std::uint32_t on_proxy = 0;
  for (const Contact& c : engine_->contacts()) {
    const double magnitude = c.normal_impulse + c.tangential_impulse.norm();
    indicators_.total_impulse_n_s += magnitude;
    if (c.a != spec_.proxy && c.b != spec_.proxy) continue;
    indicators_.proxy_impulse_n_s += magnitude;
    ++on_proxy;
  }
  indicators_.proxy_contacts = std::max(indicators_.proxy_contacts, on_proxy);
}

const HapticReport& SubWorld::report(std::int64_t sent_ns) {
  if (steps_ > 0) ++stamp_;
  in_cycle_s_ = 0.0;
  HapticReport& report = reports_[stamp_ % reports_.size()];
  report.user = UserId{static_cast<std::uint32_t>(user_)};
  report.stamp = stamp_;
  report.stamp_s = time_s();
  report.sent_ns = sent_ns;
  report.confirmed_stamp = frame_.stamp;
  report.impulse = impulse_;
  impulse_total_.force += impulse_.force;
  impulse_total_.torque += impulse_.torque;
  report.impulse_total = impulse_total_;
  report.device_work_j = device_work_j_;
  report.proxy = proxy();
  const bool spring = spec_.device.kind == DeviceKind::impedance;
  report.coupling_energy_j = spring ? coupling_energy(spec_.coupling, limits_, report.proxy, device_) : 0.0;
  report.device_pose = device_.pose;
  report.device_linear_velocity = device_.linear_velocity;
  report.device_angular_velocity = device_.angular_velocity;
  report.device_applied = applied_;
  report.members.clear();
  if (engine_) {
    for (const BodyId id : members_) report.members.push_back({id, engine_->state(id)});
    if (scheme_->has_ghosts()) describe_islands(report.islands);
    ghosts_.log(stamp_, *engine_);
  }
  report.indicators = indicators_;
  report.indicators.border_bodies = static_cast<std::uint32_t>(border_bodies_);
  indicators_ = {};
  impulse_ = {};
  steps_ = 0;
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

void SubWorld::let_peers_go() {
  for (const PeerDevice& peer : frame_.peers) {
    const Body& body = scene_.body(peer.proxy);
    if (engine_->contains(body.id)) engine_->set_inertia(body.id, body.mass, body.inertia);
  }
}

std::uint64_t SubWorld::apply(const WorldFrame& frame) {
  if (!knows(frame)) return 0;
  const bool first = frame_.members.empty();
  if (!first && frame.stamp <= frame_.stamp) return 0;
  const std::uint64_t missing = first ? 0 : frame.stamp - frame_.stamp - 1;

  if (engine_) {
    const double lag_s = time_s() - frame.stamp_s;
    const double lag_cycles = lag_s / scene_.settings.cycle_s();
    const HapticReport& mine = reports_[frame.stamp % reports_.size()];
    if (!first && mine.stamp == frame.stamp) {
      for (const PairShift& pair : synchroniser_.synchronise(frame, mine, lag_cycles)) {
        if (!engine_->contains(pair.id)) continue;
        engine_->set_state(pair.id, shifted(engine_->state(pair.id), pair.sub));
      }
    }
    let_peers_go();
    follow_membership(frame, lag_s);
    follow_ghosts(frame, lag_s);
    border_impulses_for_s_ = 0.0;
    border_bodies(frame.border, scratch_);
    border_bodies_ = scratch_.size();
  }
  for (const StampedBody& s : frame.states) {
    if (s.id == spec_.proxy) world_proxy_ = s.state;
  }
  frame_ = frame;
  return missing;
}

void SubWorld::follow_membership(const WorldFrame& frame, double lag_s) {
  const auto remove = [&](std::vector<BodyId>& have, const std::vector<BodyId>& want) {
    missing_from(have, want, scratch_);
    for (const BodyId id : scratch_) engine_->remove(id);
    std::erase_if(have, [&](BodyId id) { return std::binary_search(scratch_.begin(), scratch_.end(), id); });
  };
  remove(members_, frame.members);
  remove(fixed_, frame.fixed);
  for (const BodyId id : frame.members) {
    const std::optional<BodyState> handed_over = ghosts_.release(id, *engine_);
    if (!handed_over) continue;
    engine_->add(scene_.body(id), *handed_over);
    members_.insert(std::ranges::lower_bound(members_, id), id);
  }
  for (const EnteringBody& entering : frame.entering) {
    const BodyId id = entering.body.id;
    std::vector<BodyId>& have = entering.body.fixed() ? fixed_ : members_;
    const std::vector<BodyId>& want = entering.body.fixed() ? frame.fixed : frame.members;
    if (engine_->contains(id) || !std::binary_search(want.begin(), want.end(), id)) continue;
    engine_->add(entering.body, advanced(entering.state, lag_s));
    have.insert(std::lower_bound(have.begin(), have.end(), id), id);
  }
}

void SubWorld::follow_ghosts(const WorldFrame& frame, double lag_s) {
  const double lag_cycles = lag_s / scene_.settings.cycle_s();
  const Correction part = scheme_->correction({.lag_cycles = lag_cycles}, {});
  ghosts_.follow(frame, *engine_, lag_s, part.sub);
}

void SubWorld::describe_islands(std::vector<std::uint32_t>& labels) {
  islands_.begin(members_);
  for (const Contact& c : engine_->contacts()) {
    if (!scene_.body(c.a).fixed() && !scene_.body(c.b).fixed()) islands_.join(c.a, c.b);
  }
  islands_.labels(labels);
}

bool SubWorld::adopt(const WorldFrame& frame) {
  if (!knows(frame)) return false;
  if (engine_) {
    let_peers_go();
    for (const StampedBody& s : frame.states) {
      if (engine_->contains(s.id)) engine_->set_state(s.id, s.state);
    }
    ghosts_.clear(*engine_);
    follow_membership(frame, 0.0);
    follow_ghosts(frame, 0.0);
    finite_ = true;
  }
  for (const StampedBody& s : frame.states) {
    if (s.id == spec_.proxy) world_proxy_ = s.state;
  }
  stamp_ = frame.stamp;
  in_cycle_s_ = 0.0;
  steps_ = 0;
  indicators_ = {};
  impulse_ = {};
  frame_ = frame;
  border_impulses_for_s_ = 0.0;
  return !engine_ || engine_->contains(spec_.proxy);
}

}  // namespace subworld
