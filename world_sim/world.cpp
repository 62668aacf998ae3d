#include "world_sim/world.hpp"

#include "coupling/plan.hpp"
#include "coupling/sync/blend.hpp"
#include "model/surfaces.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <utility>

namespace subworld {

namespace {

/// The world divides its step itself, to drive the proxies in each part.
EngineSettings without_substeps(EngineSettings settings) {
  settings.substeps.reset();
  return settings;
}

std::vector<BodyId> proxies_of(const Scene& scene) {
  std::vector<BodyId> proxies;
  for (const UserSpec& user : scene.users) proxies.push_back(user.proxy);
  return proxies;
}

/// Those that move at t = 0.
std::vector<BodyId> launched_bodies(const Scene& scene) {
  std::vector<BodyId> launched;
  for (const Body& body : scene.bodies) {
    const BodyState& start = scene.initial[index(body.id)];
    if (!body.fixed() && (!start.linear_velocity.isZero(0.0) || !start.angular_velocity.isZero(0.0)))
      launched.push_back(body.id);
  }
  return launched;
}

}  // namespace

World::World(const Scene& scene, const std::function<void(double)>& progress, const EngineMaker& make)
    : scene_(scene),
      scheme_(scheme_of(scene.settings)),
      side_(scheme_.make_world_side(scene)),
      has_driven_surfaces_(has_driven_surfaces(scene)),
      live_(make(without_substeps(scene.settings.world), scene.meshes)),
      engine_(live_, scene, proxies_of(scene), enabled(scene, Optimisation::rest), enabled(scene, Optimisation::sway)),
      plan_(scene, scheme_, without_substeps(scene.settings.world)),
      contacts_(scene, scheme_.properties.has_sub_worlds, engine_),
      shared_(scene),
      frames_(scene, scheme_, *side_, remembered_cycles(scene.settings, scheme_)),
      accounts_(scene, remembered_cycles(scene.settings, scheme_)) {
  engine_.set_joints(scene.joints);
  const auto users = static_cast<std::size_t>(scene.settings.users);
  links_.reserve(users);
  tools_.reserve(users);
  for (std::size_t u = 0; u < users; ++u) {
    links_.emplace_back(scheme_, scene, u);
    tools_.emplace_back(scene.users[u], scene.body(scene.users[u].proxy));
  }
  facts_.engine = engine_.name();
  facts_.ratio = scene.settings.ratio;
  set_stamp(0);
  begin_cycle();
  const auto later = [&](BodyId id) {
    return std::ranges::any_of(scene.users, [&](const UserSpec& user) { return user.joins_late && user.proxy == id; });
  };
  for (const Body& body : scene.bodies) {
    if (!later(body.id)) engine_.add(body, scene.initial[index(body.id)]);
    if (engine_.asleep(body.id)) accounts_.sleeps(engine_, body.id);
    if (progress) progress(static_cast<double>(index(body.id) + 1) / static_cast<double>(scene.bodies.size()));
  }
}

bool World::settle(const std::function<bool(double)>& progress) {
  const double dt = scene_.settings.settle_step_s;
  const auto steps = static_cast<int>(std::lround(scene_.settings.settle_s / dt));
  const std::vector<BodyId> launched = launched_bodies(scene_);
  const auto hold = [&](bool still) {
    for (const BodyId id : launched) {
      const BodyState& start = scene_.initial[index(id)];
      engine_.set_state(id, still ? BodyState{start.position, start.orientation} : start);
    }
  };
  for (int i = 0; i < steps; ++i) {
    hold(true);
    rest(dt);
    for (std::size_t u = 0; u < links_.size(); ++u) {
      const UserSpec& user = scene_.users[u];
      if (user.joins_late) continue;
      const BodyState& start = scene_.initial[index(user.proxy)];
      pull(u, {.pose = {start.position, start.orientation}}, limits_of(user.device), dt);
    }
    engine_.step(dt);
    if (!progress(static_cast<double>(i + 1) / steps)) return false;
  }
  if (steps > 0) hold(false);
  for (const UserLink& link : links_) {
    if (!link.spec().joins_late) set_inertia(scene_.body(link.spec().proxy));
  }
  contacts_.take_settled(facts_.cycle_s / dt);
  for (const UserSpec& user : scene_.users) {
    if (user.joins_late) engine_.add(scene_.body(user.proxy), scene_.initial[index(user.proxy)]);
  }
  account();
  make_frames();
  double stored_j = 0.0;
  for (std::size_t u = 0; u < links_.size(); ++u) {
    const UserSpec& user = scene_.users[u];
    const DevicePose device{.pose = pose_of(scene_.initial[index(user.proxy)])};
    if (!user.joins_late) stored_j += coupling_energy(user.coupling, limits_of(user.device), proxy(u), device);
  }
  accounts_.begin(facts_, stored_j);
  return true;
}

OrderAnswer World::change_engine(EngineExchange& exchange, const EngineOrder& order) {
  EngineSettings settings = without_substeps(scene_.settings.world);
  settings.change_to(order.engine, order.preset);
  if (std::string text = exchange.refusal(settings); !text.empty()) return {OrderState::refused, std::move(text)};
  engine_.wake_all();  // the other engine must be able to hold those too that sleep
  exchange.begin(settings, live_, facts_.cycle_s / facts_.substeps, order.number);
  plan_.ask_for(settings);
  return {OrderState::preparing, "preparing engine " + order.engine};
}

bool World::exchange_engine(EngineExchange& exchange) {
  if (!exchange.poll(live_)) return false;
  contacts_.clear();
  plan_.exchange_engine();
  facts_.engine = engine_.name();
  return true;
}

void World::begin_cycle() {
  facts_.cycle_s = plan_.cycle_s(facts_.stamp);
  const Capabilities can = engine_.capabilities();
  facts_.substeps = plan_.substeps(facts_.stamp, facts_.substeps, can.longest_step_s, !can.drives_inside, load());
}

bool World::receive(HapticReport&& report) {
  const std::size_t user = index(report.user);
  if (user >= links_.size()) return false;
  // A sub-world that has missed a change of the ratio counts other cycles.
  const double stamp_s = plan_.seconds(plan_.timetable().start(report.stamp));
  if (std::abs(report.stamp_s - stamp_s) > 0.5 * scene_.settings.h_s) return false;
  return links_[user].receive(report, facts_.stamp, proxy(user));
}

void World::synchronise() {
  const std::uint64_t remembered = frames_.remembered();
  const std::uint64_t oldest = facts_.stamp >= remembered ? facts_.stamp - remembered + 1 : 0;
  const double until_s = plan_.seconds(plan_.timetable().start(std::max<std::uint64_t>(report_stamp(), 1) - 1));
  for (std::size_t u = 0; u < links_.size(); ++u) {
    for (std::uint64_t stamp = oldest; stamp <= facts_.stamp; ++stamp) {
      const HapticReport* const report = links_[u].take(stamp);
      if (report == nullptr) continue;
      if (scheme_.properties.has_sub_worlds && stamp > 0) apply(u, *report);
      frames_.observe_step(u, report->timing.mean_s);
      if (links_[u].used(stamp, until_s)) set_inertia(tools_[u].at_rate().body);
    }
  }
  accounts_.balance(links_, facts_);
}

void World::apply(std::size_t user, const HapticReport& report) {
  const WorldFrame& said = frames_.frame(user, report.stamp);
  if (said.stamp != report.stamp) return;
  for (const PairShift& pair : links_[user].shifts(said, report)) {
    const double share = Authority::share(frames_.holders(pair.id));
    const Shift shift = share < 1.0 ? scaled(pair.world, share) : pair.world;
    const BodyState to = shifted(engine_.state(pair.id), shift);
    if (engine_.asleep(pair.id) && engine_.negligible(pair.id, to)) continue;  // the sub-world's last word of it
    engine_.set_state(pair.id, to);
  }
}

void World::simulate_cycle() {
  const double dt = facts_.cycle_s / facts_.substeps;
  pass_impulses();
  driven_.clear();
  for (const UserLink& link : links_) {
    if (link.holds() || link.drives()) driven_.push_back(link.spec().proxy);
  }
  for (int i = 0; i < facts_.substeps; ++i) {
    const double begin_s = facts_.time_s + i * dt;
    engine_.step_driven(dt, driven_, [&](double until_s, double h) { drive_proxies(begin_s + until_s, h); });
    contacts_.add(i, facts_.substeps);
    break_joints(dt);
  }
  if (has_driven_surfaces_) accounts_.drive_works(surface_work(scene_, contacts_.all()));
}

void World::break_joints(double dt) {
  const std::span<const JointLoad> loads = engine_.joint_loads();
  for (std::size_t j = 0; j < loads.size(); ++j) {
    const Joint& joint = scene_.joints[j];
    accounts_.drive_works(loads[j].motor_j);
    if (loads[j].impulse.norm() <= dt * joint.break_force_n && loads[j].turn.norm() <= dt * joint.break_torque_n_m)
      continue;
    break_joint(j);
  }
}

void World::break_joint(std::size_t joint) {
  engine_.break_joint(joint);
  frames_.break_joint(joint);
  accounts_.break_joint(joint);
}

void World::rest(double dt) {
  engine_.follow(dt, looked_ahead_s(scene_.settings, scheme_, facts_.cycle_s));
  accounts_.follow_rest(engine_);
}

void World::simulate() {
  rest(facts_.cycle_s);
  begin_cycle();
  simulate_cycle();
  facts_.ratio = plan_.timetable().ratio(facts_.stamp);
  set_stamp(facts_.stamp + 1);
  merge_shared();
}

void World::merge_shared() {
  if (!scheme_.properties.merges_shared_islands || links_.size() < 2) return;
  std::array<const HapticReport*, kMostUsers> reports{};
  for (std::size_t u = 0; u < links_.size(); ++u) {
    const HapticReport& report = links_[u].reports().at(facts_.stamp);
    reports[u] = report.stamp == facts_.stamp ? &report : nullptr;
  }
  const std::span all(reports.data(), links_.size());
  for (const auto& [id, mean, weight] : shared_.merge(contacts_.all(), all, facts_.cycle_s)) {
    const BodyState to = blend(engine_.state(id), advanced(mean, half_step_offset_s()), weight);
    if (!engine_.asleep(id) || !engine_.negligible(id, to)) engine_.set_state(id, to);
  }
}

void World::set_stamp(std::uint64_t stamp) noexcept {
  facts_.stamp = stamp;
  facts_.time_s = plan_.seconds(plan_.timetable().start(stamp));
  facts_.over = facts_.time_s + 0.5 * plan_.cycle_s(stamp) > scene_.settings.duration_s;
}

void World::close() {
  if (scheme_.properties.has_sub_worlds) synchronise();
  account();
}

void World::make_frames() {
  contacts_.build_graph();
  const std::function<bool()> friction = [this] { return contacts_.find_friction(); };
  const WorldNow now{facts_.stamp,    facts_.time_s, facts_.cycle_s,    plan_.timetable(),  engine_,
                     contacts_.all(), friction,      contacts_.graph(), accounts_.motions()};
  if (plan_.is_due(facts_.stamp)) {
    const bool felt = frames_.border_is_felt(now, plan_.ahead_s(facts_.cycle_s));
    facts_.ratio_changes += plan_.choose(facts_.stamp, facts_.cycle_s, felt, load()) ? 1 : 0;
  }
  frames_.make(now, links_, -half_step_offset_s());
  for (std::size_t u = 0; u < links_.size(); ++u) {
    if (links_[u].reports().waits_for_frame(facts_.stamp)) links_[u].begin_suppression(frames_.frame(u, facts_.stamp));
  }
}

double World::half_step_offset_s() const {
  if (scheme_.properties.lead_cycles == 0) return 0.0;
  return 0.5 * (engine_.integration_substep_s(facts_.cycle_s / facts_.substeps) - scene_.settings.h_s);
}

UserFacts World::user_facts(std::size_t user) const noexcept {
  const UserLink& link = links_[user];
  return {link.reports().waits_for_frame(facts_.stamp),
          frames_.border(user).contacts,
          frames_.border(user).outside.size(),
          frames_.selection(user),
          link.impulse(),
          link.reports().newest_stamp(),
          link.presence() == UserPresence::absent};
}

void World::look(WorldView& view) const {
  view.stamp_s = facts_.time_s;
  view.states.resize(scene_.bodies.size());
  for (const Body& body : scene_.bodies) view.states[index(body.id)] = engine_.state(body.id);
  view.broken_joints.assign(broken_joints().begin(), broken_joints().end());
  view.users.resize(links_.size());
  for (std::size_t u = 0; u < links_.size(); ++u) {
    const ReportInbox& reports = links_[u].reports();
    UserView& seen = view.users[u];
    seen.user = UserId{static_cast<std::uint32_t>(u)};
    seen.proxy = links_[u].spec().proxy;
    seen.members = frames_.membership(u).members;
    seen.border.clear();
    std::ranges::copy_if(frames_.border(u).contacts, std::back_inserter(seen.border), touches);
    seen.wrench = mean_wrench(reports.before(), reports.newest());
  }
}

}  // namespace subworld
