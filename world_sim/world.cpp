#include "world_sim/world.hpp"

#include "coupling/blend.hpp"
#include "coupling/plan.hpp"
#include "coupling/swept_bounds.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
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

/// Slower motion cannot be felt, m/s.
constexpr double kStill_m_s = 5e-3;

/// How far a contact point may move in a sub-step, of the smaller body's size.
constexpr double kContactReachRatio = 0.025;

}  // namespace

World::World(const Scene& scene, const std::function<void(double)>& progress, const EngineMaker& make)
    : scene_(scene),
      scheme_(scheme_of(scene.settings)),
      side_(scheme_.make_world_side(scene)),
      live_(make(without_substeps(scene.settings.world), scene.meshes)),
      engine_(live_, scene, proxies_of(scene), enabled(scene, Optimisation::rest), enabled(scene, Optimisation::sway)),
      users_(static_cast<std::size_t>(scene.settings.users)),
      remembered_(remembered_cycles(scene.settings, scheme_)),
      timetable_(scene.settings.ratio, remembered_),
      ratio_control_(scene.settings),
      engine_cost_(engine_cost(without_substeps(scene.settings.world))),
      reads_friction_(scheme_.properties.has_sub_worlds || !enabled(scene, Optimisation::impulses)),
      reads_friction_later_(scheme_.properties.has_sub_worlds && enabled(scene, Optimisation::impulses)),
      motions_(scene.bodies.size()),
      shared_(scene),
      reports_(users_.size()),
      frames_(scene, scheme_, *side_, remembered_),
      heard_(users_.size()),
      energy_j_(remembered_, 0.0),
      operators_(others_capacity_j(scene, users_.size())) {
  // Who repeats bit by bit and has no choice economises for nobody.
  const bool economises = scene.settings.mode == Mode::realtime || scene.settings.adapts_ratio();
  cycle_cost_ = [this, economises](double cycle_s, int parts) {
    return economises ? correction_.factor() * published_cost_s(cycle_s, parts) : 0.0;
  };
  near_.reserve(scene.bodies.size());
  facts_.engine = engine_.name();
  facts_.ratio = scene.settings.ratio;
  set_stamp(0);
  begin_cycle();
  const auto later = [&](BodyId id) {
    return std::ranges::any_of(scene.users, [&](const UserSpec& user) { return user.joins_late && user.proxy == id; });
  };
  for (const Body& body : scene.bodies) {
    if (!later(body.id)) engine_.add(body, scene.initial[index(body.id)]);
    if (engine_.asleep(body.id)) count_asleep(body.id);
    if (progress) progress(static_cast<double>(index(body.id) + 1) / static_cast<double>(scene.bodies.size()));
  }
  for (std::size_t u = 0; u < users_.size(); ++u) {
    users_[u].spec = &scene.users[u];
    users_[u].tool = tool_at(1.0, scene.users[u], scene.body(scene.users[u].proxy));
    users_[u].synchroniser = std::make_unique<Synchroniser>(scheme_, scene, u);
    users_[u].suppression = SuppressedCycles(scheme_.properties.lead_cycles);
    // A suppression ends with a report that is so much ahead.
    users_[u].inbox.resize(remembered_ + (enabled(scene, Optimisation::suppression) ? kMostSuppressedCycles : 0));
    users_[u].waiting.resize(users_[u].inbox.size());
    if (scene.settings.mode == Mode::realtime) {
      for (HapticReport& report : users_[u].inbox) reserve(report, kUsualMembers);
    }
    reserve(users_[u].report, kUsualMembers);
    reserve(users_[u].before, kUsualMembers);
  }
}

bool World::settle(const std::function<bool(double)>& progress) {
  const double dt = scene_.settings.settle_step_s;
  const auto steps = static_cast<int>(std::lround(scene_.settings.settle_s / dt));
  for (int i = 0; i < steps; ++i) {
    rest(dt);
    for (const User& user : users_) {
      if (user.spec->joins_late) continue;
      const BodyState& start = scene_.initial[index(user.spec->proxy)];
      const DevicePose device{{start.position, start.orientation}, Vec3::Zero(), Vec3::Zero()};
      pull(user, device, limits_of(user.spec->device), dt);
    }
    engine_.step(dt);
    if (!progress(static_cast<double>(i + 1) / steps)) return false;
  }
  for (const User& user : users_) {
    const Body& proxy = scene_.body(user.spec->proxy);
    if (!user.spec->joins_late) engine_.set_inertia(proxy.id, proxy.mass, proxy.inertia);
  }
  const std::span<const Contact> now = engine_.contacts_with_friction();
  settled_.assign(now.begin(), now.end());
  for (Contact& c : settled_) {
    c.normal_impulse *= facts_.cycle_s / dt;
    c.tangential_impulse *= facts_.cycle_s / dt;
  }
  contacts_ = settled_;
  for (const UserSpec& user : scene_.users) {
    if (user.joins_late) engine_.add(scene_.body(user.proxy), scene_.initial[index(user.proxy)]);
  }
  account();
  make_frames();
  start_energy_j_ = facts_.kinetic_j + facts_.potential_j;
  return true;
}

OrderAnswer World::change_engine(EngineExchange& exchange, const EngineOrder& order) {
  EngineSettings settings = without_substeps(scene_.settings.world);
  settings.change_to(order.engine, order.preset);
  if (std::string text = exchange.refusal(settings); !text.empty()) return {OrderState::refused, std::move(text)};
  engine_.wake_all();  // the other engine must be able to hold those too that sleep
  exchange.begin(settings, live_, facts_.cycle_s / facts_.substeps, order.number);
  next_engine_ = settings;
  return {OrderState::preparing, "preparing engine " + order.engine};
}

bool World::exchange_engine(EngineExchange& exchange) {
  if (!exchange.poll(live_)) return false;
  contacts_ = {};
  engine_cost_ = engine_cost(next_engine_);
  facts_.engine = engine_.name();
  return true;
}

OrderAnswer World::change_ratio(const std::string& text) {
  const RatioBounds whole = scene_.settings.ratio_bounds();
  const std::optional<RatioBounds> wanted = parse_ratio(text);
  if (!wanted) return {OrderState::refused, fmt::format("\"{}\" is no ratio; give one as 4, or two as 4-8", text)};
  if (!scene_.settings.adapts_ratio())
    return {OrderState::refused, fmt::format("the ratio of this run is fixed at {}; start a run with two bounds, as "
                                             "--ratio 4-12, to change it between them",
                                             whole.least)};
  if (wanted->least < whole.least || wanted->most > whole.most)
    return {OrderState::refused, fmt::format("this run was started with --ratio {}; stay within it", to_text(whole))};
  ratio_control_.set_bounds(*wanted);
  return {OrderState::done, fmt::format("ratio {}", to_text(*wanted))};
}

double World::published_cost_s(double cycle_s, int parts) const noexcept {
  return parts * engine_cost_.step(cycle_s / parts).of(engine_.awake().size(), contacts_.size());
}

void World::begin_cycle() {
  facts_.cycle_s = seconds(static_cast<std::uint64_t>(timetable_.ratio(facts_.stamp)));
  // A scheme that minds the world's step minds what the engine makes of it.
  const double for_scheme_s = scheme_.properties.longest_world_step_s;
  const double longest_s =
      std::isfinite(for_scheme_s) ? std::min(for_scheme_s, engine_.capabilities().longest_step_s) : for_scheme_s;
  const auto lead = static_cast<std::uint64_t>(scheme_.properties.lead_cycles);
  const double time_s = seconds(static_cast<std::uint64_t>(timetable_.ratio(facts_.stamp + lead)));
  facts_.substeps = ratio_control_.choose_substeps(facts_.substeps, facts_.cycle_s, longest_s, time_s, cycle_cost_);
}

bool World::border_is_felt(std::size_t user) {
  const WorldFrame& frame = frames_.frame(user, facts_.stamp == 0 ? 0 : facts_.stamp - 1);
  if (frames_.border(user).empty()) return false;
  const double until_s = static_cast<double>(planned_cycles(scene_.settings, scheme_)) * facts_.cycle_s;
  const BodyId proxy = users_[user].spec->proxy;
  const BodyState& now = motions_[index(proxy)].state;
  const Box reach = swept_bounds(now, engine_.bounds(proxy), scene_.settings.world.gravity.norm(), until_s);
  engine_.overlap(reach, near_);
  const auto is_other = [&](BodyId id) { return id != proxy && !scene_.body(id).fixed(); };
  const auto moves = [&](BodyId id) { return motions_[index(id)].state.linear_velocity.norm() > kStill_m_s; };
  return std::ranges::any_of(near_, is_other) && std::ranges::any_of(frame.members, moves);
}

void World::plan_ratio() {
  if (!scene_.settings.adapts_ratio() || timetable_.newest().stamp > facts_.stamp) return;
  bool felt = false;
  for (std::size_t u = 0; u < users_.size() && !felt; ++u) felt = border_is_felt(u);
  const int present = timetable_.ratio(facts_.stamp);
  const int ratio = ratio_control_.choose_ratio(present, felt, facts_.cycle_s, cycle_cost_);
  facts_.ratio_changes += ratio != present;
  timetable_.plan({facts_.stamp + planned_cycles(scene_.settings, scheme_), ratio});
}

bool World::receive(HapticReport&& report) {
  if (index(report.user) >= users_.size()) return false;
  User& user = users_[index(report.user)];
  if (user.heard && report.stamp <= user.report.stamp) return false;
  const std::uint64_t most_ahead = user.inbox.size() - remembered_ / 2;
  if (report.stamp > facts_.stamp + most_ahead || report.stamp + remembered_ <= facts_.stamp) return false;
  // A sub-world that has missed a change of the ratio counts other cycles.
  const double stamp_s = seconds(timetable_.start(report.stamp));
  if (std::abs(report.stamp_s - stamp_s) > 0.5 * scene_.settings.h_s) return false;
  if (user.absent && report.started_stamp < user.joins_from) return false;
  if (report.started_stamp > user.started_stamp || (user.held && !user.joins_at)) {
    begin_join(index(report.user), report);
  } else if (!user.counted) {
    begin_count(user, report);
  }
  user.counted = true;
  report.impulse_total.force += user.before_join.impulse.force;
  report.impulse_total.torque += user.before_join.impulse.torque;
  report.device_work_j += user.before_join.device_work_j;
  report.operator_work_j += user.before_join.operator_work_j;
  const std::size_t slot = report.stamp % user.inbox.size();
  std::swap(user.inbox[slot], report);  // the caller goes on with the old one's memory
  user.waiting[slot] = true;
  user.newest_stamp = std::max(user.newest_stamp, user.inbox[slot].stamp);
  user.suppression.end(user.inbox[slot].stamp);
  return true;
}

void World::synchronise() {
  const std::uint64_t oldest = facts_.stamp >= remembered_ ? facts_.stamp - remembered_ + 1 : 0;
  for (std::size_t u = 0; u < users_.size(); ++u) {
    User& user = users_[u];
    for (std::uint64_t j = oldest; j <= facts_.stamp; ++j) {
      const std::size_t slot = j % user.inbox.size();
      if (!user.waiting[slot] || user.inbox[slot].stamp != j) continue;
      user.waiting[slot] = false;
      if (user.heard && j <= user.report.stamp) continue;
      if (scheme_.properties.has_sub_worlds && j > 0) apply(u, user.inbox[slot]);
      frames_.observe_step(u, user.inbox[slot].timing.mean_s);
      std::swap(user.before, user.report);
      std::swap(user.report, user.inbox[slot]);
      user.heard = true;
      if (user.joins_at && user.before.stamp >= *user.joins_at) end_join(user);
    }
  }
  balance();
}

void World::apply(std::size_t user, const HapticReport& report) {
  const WorldFrame& said = frames_.frame(user, report.stamp);
  if (said.stamp != report.stamp) return;
  // What the sub-world makes of this frame is not known here: as if it were too old to correct anything.
  for (const PairShift& pair : users_[user].synchroniser->synchronise(said, report, INFINITY)) {
    const double share = Authority::share(frames_.holders(pair.id));
    const Shift shift = share < 1.0 ? scaled(pair.world, share) : pair.world;
    const BodyState to = shifted(engine_.state(pair.id), shift);
    if (engine_.asleep(pair.id) && engine_.negligible(pair.id, to)) continue;  // the sub-world's last word of it
    engine_.set_state(pair.id, to);
  }
}

std::span<const Contact> World::contacts_of_step() {
  lacks_friction_ = !reads_friction_;
  if (reads_friction_later_ && facts_.substeps == 1) {
    lacks_friction_ = engine_.capabilities().tangential_impulse == Fidelity::estimated;
  }
  return lacks_friction_ ? engine_.contacts() : engine_.contacts_with_friction();
}

bool World::find_friction() {
  if (!std::exchange(lacks_friction_, false)) return false;
  contacts_ = engine_.contacts_with_friction();
  graph_.build(contacts_, scene_.bodies.size());
  return true;
}

void World::simulate_cycle() {
  const double dt = facts_.cycle_s / facts_.substeps;
  totals_.clear();
  pass_impulses();
  for (int i = 0; i < facts_.substeps; ++i) {
    drive_proxies(facts_.time_s + (i + 1) * dt, dt);
    engine_.step(dt);
    if (facts_.substeps == 1) {
      contacts_ = contacts_of_step();
      return;
    }
    for (const Contact& c : contacts_of_step()) {
      const auto size = [&](BodyId id) {
        const Box box = engine_.bounds(id);
        return (box.upper - box.lower).minCoeff();
      };
      totals_.add(c, i, kContactReachRatio * std::min(size(c.a), size(c.b)));
    }
  }
  totals_.merge();
  contacts_ = totals_.contacts();
}

void World::rest(double dt) {
  engine_.follow(dt, looked_ahead_s(scene_.settings, scheme_, facts_.cycle_s));
  for (const BodyId id : engine_.woke()) resting_j_ -= potential_j(id);
  for (const BodyId id : engine_.fell_asleep()) count_asleep(id);
}

void World::simulate() {
  rest(facts_.cycle_s);
  begin_cycle();
  simulate_cycle();
  facts_.ratio = timetable_.ratio(facts_.stamp);
  set_stamp(facts_.stamp + 1);
  merge_shared();
}

void World::merge_shared() {
  if (!scheme_.properties.merges_shared_islands || users_.size() < 2) return;
  for (std::size_t u = 0; u < users_.size(); ++u) {
    const HapticReport& report = users_[u].at(facts_.stamp);
    reports_[u] = report.stamp == facts_.stamp ? &report : nullptr;
  }
  for (const auto& [id, mean, weight] : shared_.merge(contacts_, reports_, facts_.cycle_s)) {
    const BodyState to = blend(engine_.state(id), advanced(mean, half_step_offset_s()), weight);
    if (!engine_.asleep(id) || !engine_.negligible(id, to)) engine_.set_state(id, to);
  }
}

void World::set_stamp(std::uint64_t stamp) noexcept {
  facts_.stamp = stamp;
  facts_.time_s = seconds(timetable_.start(stamp));
  const double half_cycle_s = 0.5 * seconds(static_cast<std::uint64_t>(timetable_.ratio(stamp)));
  facts_.over = facts_.time_s + half_cycle_s > scene_.settings.duration_s;
}

void World::close() {
  if (scheme_.properties.has_sub_worlds) synchronise();
  account();
}

void World::make_frames() {
  plan_ratio();
  graph_.build(contacts_, scene_.bodies.size());
  for (std::size_t u = 0; u < users_.size(); ++u)
    heard_[u] = {users_[u].heard, &users_[u].report, &users_[u].at(facts_.stamp), !waits_for_frame(users_[u]),
                 users_[u].held ? &users_[u].held->pose : nullptr};
  pulls_.clear();
  for (const User& user : users_) {
    const bool spring = user.held || user.spec->device.kind == DeviceKind::impedance;
    if (user.heard || user.held) pulls_.push_back({user.spec->proxy, user.mean.force, spring});
  }
  const std::function<bool()> friction = [this] { return find_friction(); };
  frames_.make(
      {facts_.stamp, facts_.time_s, facts_.cycle_s, timetable_, engine_, contacts_, friction, graph_, motions_, pulls_},
      heard_, -half_step_offset_s());
  for (std::size_t u = 0; u < users_.size(); ++u) {
    if (waits_for_frame(users_[u])) users_[u].suppression.begin(frames_.frame(u, facts_.stamp));
  }
}

double World::half_step_offset_s() const {
  if (scheme_.properties.lead_cycles == 0) return 0.0;
  return 0.5 * (engine_.integration_substep_s(facts_.cycle_s / facts_.substeps) - scene_.settings.h_s);
}

UserFacts World::user_facts(std::size_t user) const noexcept {
  return {waits_for_frame(users_[user]),  frames_.border(user),      frames_.selection(user),
          users_[user].impulse.applied(), users_[user].newest_stamp, users_[user].absent};
}

void World::look(WorldView& view) const {
  view.stamp_s = facts_.time_s;
  view.states.resize(scene_.bodies.size());
  for (const Body& body : scene_.bodies) view.states[index(body.id)] = engine_.state(body.id);
  view.users.resize(users_.size());
  for (std::size_t u = 0; u < users_.size(); ++u) {
    const User& user = users_[u];
    UserView& seen = view.users[u];
    seen.user = UserId{static_cast<std::uint32_t>(u)};
    seen.proxy = user.spec->proxy;
    seen.members = frames_.membership(u).members;
    seen.border.clear();
    std::ranges::copy_if(frames_.border(u), std::back_inserter(seen.border), touches);
    seen.wrench = mean_wrench(user.before, user.report);
  }
}

}  // namespace subworld
