#include "world_sim/world.hpp"

#include "coupling/border.hpp"
#include "coupling/virtual_coupling.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <optional>

namespace subworld {

namespace {

constexpr std::uint64_t kHashSeed = 0xcbf29ce484222325ULL;
constexpr std::uint64_t kHashPrime = 0x100000001b3ULL;

void mix(std::uint64_t& hash, double value) noexcept {
  std::uint64_t word;
  std::memcpy(&word, &value, sizeof word);
  hash = (hash ^ word) * kHashPrime;
  hash ^= hash >> 32;
}

void mix(std::uint64_t& hash, const BodyState& s) noexcept {
  for (int i = 0; i < 3; ++i) mix(hash, s.position[i]);
  for (int i = 0; i < 4; ++i) mix(hash, s.orientation.coeffs()[i]);
  for (int i = 0; i < 3; ++i) mix(hash, s.linear_velocity[i]);
  for (int i = 0; i < 3; ++i) mix(hash, s.angular_velocity[i]);
}

/// The world divides its step itself, to drive the proxies in each part.
EngineSettings without_substeps(EngineSettings settings) {
  settings.substeps.reset();
  return settings;
}

/// How far a contact point may move in a sub-step, of the smaller body's size.
constexpr double kContactReachRatio = 0.025;

/// Whether a sub-world that has taken the frame holds the body, in whatever role.
bool names(const WorldFrame& frame, BodyId id) {
  return std::ranges::binary_search(frame.members, id) || std::ranges::binary_search(frame.fixed, id) ||
         std::ranges::binary_search(frame.ghosts, id, {}, &GhostModel::outside);
}

void sort_unique(std::vector<BodyId>& ids) {
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
}

}  // namespace

World::World(const Scene& scene)
    : scene_(scene),
      scheme_(make_scheme(scene.settings)),
      engine_(std::make_unique<LiveEngine>(make_engine(without_substeps(scene.settings.world), scene.meshes))),
      users_(static_cast<std::size_t>(scene.settings.users)),
      hash_(kHashSeed),
      remembered_(remembered_cycles(scene.settings, *scheme_)),
      approach_(scene),
      modeller_(scene),
      motions_(scene.bodies.size()),
      energy_j_(remembered_, 0.0) {
  choose_substeps();
  const auto later = [&](BodyId id) {
    return std::ranges::any_of(scene.users, [&](const UserSpec& user) { return user.joins_late && user.proxy == id; });
  };
  for (const Body& body : scene.bodies) {
    if (!later(body.id)) engine_->add(body, scene.initial[index(body.id)]);
  }
  for (std::size_t u = 0; u < users_.size(); ++u) {
    users_[u].spec = &scene.users[u];
    std::vector<BodyId> peers;
    for (std::size_t p = 0; p < users_.size(); ++p) {
      if (p != u) peers.push_back(scene.users[p].proxy);
    }
    users_[u].synchroniser =
        std::make_unique<Synchroniser>(*scheme_, remembered_, scene.users[u].proxy, std::move(peers));
    users_[u].frames.resize(remembered_);
    users_[u].inbox.resize(remembered_);
    users_[u].waiting.resize(remembered_);
    for (WorldFrame& frame : users_[u].frames) reserve(frame, kUsualMembers);
    for (HapticReport& report : users_[u].inbox) reserve(report, kUsualMembers);
    reserve(users_[u].report, kUsualMembers);
    reserve(users_[u].before, kUsualMembers);
  }
}

bool World::settle(const std::function<bool(double)>& progress) {
  const double dt = scene_.settings.settle_step_s;
  const auto steps = static_cast<int>(std::lround(scene_.settings.settle_s / dt));
  for (int i = 0; i < steps; ++i) {
    for (const User& user : users_) {
      if (user.spec->joins_late) continue;
      const BodyState& start = scene_.initial[index(user.spec->proxy)];
      const DevicePose device{{start.position, start.orientation}, Vec3::Zero(), Vec3::Zero()};
      hold(*user.spec, device, limits_of(user.spec->device), dt);
    }
    engine_->step(dt);
    if (!progress(static_cast<double>(i + 1) / steps)) return false;
  }
  for (const User& user : users_) {
    const Body& proxy = scene_.body(user.spec->proxy);
    if (!user.spec->joins_late) engine_->set_inertia(proxy.id, proxy.mass, proxy.inertia);
  }
  settled_.assign(engine_->contacts().begin(), engine_->contacts().end());
  for (Contact& c : settled_) {
    c.normal_impulse *= scene_.settings.cycle_s() / dt;
    c.tangential_impulse *= scene_.settings.cycle_s() / dt;
  }
  contacts_ = settled_;
  for (const UserSpec& user : scene_.users) {
    if (user.joins_late) engine_->add(scene_.body(user.proxy), scene_.initial[index(user.proxy)]);
  }
  account();
  extract();
  start_energy_j_ = kinetic_j_ + potential_j_;
  return true;
}

std::string World::change_engine(EngineExchange& exchange, const EngineOrder& order) {
  EngineSettings settings = without_substeps(scene_.settings.world);
  if (order.engine != settings.name) settings.iterations = settings.substeps = std::nullopt;  // meant for that one
  settings.name = order.engine;
  settings.preset = order.preset;
  const bool begun = exchange.begin(settings, *engine_, scene_.settings.cycle_s() / substeps_, order.number);
  return begun ? "preparing engine " + order.engine : "refused: another change of engine is under way; try again";
}

bool World::exchange_engine(EngineExchange& exchange) {
  if (!exchange.poll(*engine_)) return false;
  contacts_ = {};
  choose_substeps();
  return true;
}

void World::choose_substeps() {
  // A scheme that minds the world's step minds what the engine makes of it.
  const double for_scheme_s = scheme_->longest_world_step_s();
  const double longest_s =
      std::isfinite(for_scheme_s) ? std::min(for_scheme_s, engine_->capabilities().longest_step_s) : for_scheme_s;
  const auto needed = static_cast<int>(std::ceil(scene_.settings.cycle_s() / longest_s - 1e-9));
  substeps_ = scene_.settings.world.substeps.value_or(std::max(1, needed));
}

bool World::receive(HapticReport&& report) {
  if (index(report.user) >= users_.size()) return false;
  User& user = users_[index(report.user)];
  if (user.heard && report.stamp <= user.report.stamp) return false;
  if (report.stamp > stamp_ + remembered_ / 2 || report.stamp + remembered_ <= stamp_) return false;
  const std::size_t slot = report.stamp % remembered_;
  user.inbox[slot] = std::move(report);
  user.waiting[slot] = true;
  return true;
}

void World::synchronise() {
  const std::uint64_t oldest = stamp_ >= remembered_ ? stamp_ - remembered_ + 1 : 0;
  for (User& user : users_) {
    for (std::uint64_t j = oldest; j <= stamp_; ++j) {
      const std::size_t slot = j % remembered_;
      if (!user.waiting[slot] || user.inbox[slot].stamp != j) continue;
      user.waiting[slot] = false;
      if (user.heard && j <= user.report.stamp) continue;
      if (scheme_->has_sub_world() && j > 0) apply(user, user.inbox[slot]);
      std::swap(user.before, user.report);
      std::swap(user.report, user.inbox[slot]);
      user.heard = true;
    }
  }
  balance();
}

void World::apply(User& user, const HapticReport& report) {
  const WorldFrame& said = user.frames[report.stamp % remembered_];
  if (said.stamp != report.stamp) return;
  // What the sub-world makes of this frame is not known here: as if it were too old to correct anything.
  for (const PairShift& pair : user.synchroniser->synchronise(said, report, INFINITY)) {
    const int n = sharers(pair.id);
    const Shift shift = n > 1 ? scaled(pair.world, 1.0 / n) : pair.world;
    engine_->set_state(pair.id, shifted(engine_->state(pair.id), shift));
  }
}

int World::sharers(BodyId id) const {
  return static_cast<int>(std::count_if(users_.begin(), users_.end(), [&](const User& user) {
    return std::binary_search(user.membership.members.begin(), user.membership.members.end(), id);
  }));
}

void World::hold(const UserSpec& user, const DevicePose& target, const ForceLimits& limits, double dt) {
  const ImplicitStep coupling =
      implicit_step(user.coupling, limits, scene_.body(user.proxy), engine_->state(user.proxy), target, dt);
  engine_->set_inertia(user.proxy, coupling.mass, coupling.inertia);
  engine_->set_velocity(user.proxy, coupling.start.linear_velocity, coupling.start.angular_velocity);
  engine_->apply_force(user.proxy, coupling.wrench.force, coupling.wrench.torque);
}

void World::drive_proxies(double until_s, double dt) {
  for (const User& user : users_) {
    if (!user.heard) continue;
    // A report that is ahead of the world tells what the user does in this very cycle.
    const HapticReport& now = user.at(wants());
    const HapticReport& before = &now == &user.report ? user.before : user.report;
    const ProxyDrive drive = scheme_->drive(*user.spec, before, now, until_s + lead_s());
    if (drive.target) hold(*user.spec, *drive.target, drive.limits, dt);
    engine_->apply_force(user.spec->proxy, drive.wrench.force, drive.wrench.torque);
  }
}

void World::simulate_cycle() {
  const double dt = scene_.settings.cycle_s() / substeps_;
  totals_.clear();
  for (int i = 0; i < substeps_; ++i) {
    drive_proxies(time_s() + (i + 1) * dt, dt);
    engine_->step(dt);
    if (substeps_ == 1) {
      contacts_ = engine_->contacts();
      return;
    }
    for (const Contact& c : engine_->contacts()) {
      const auto size = [&](BodyId id) {
        const Box box = engine_->bounds(id);
        return (box.upper - box.lower).minCoeff();
      };
      totals_.add(c, i, kContactReachRatio * std::min(size(c.a), size(c.b)));
    }
  }
  totals_.merge();
  contacts_ = totals_.contacts();
}

void World::step() {
  synchronise();
  simulate_cycle();
  ++stamp_;
  account();
  extract();
}

void World::extract() {
  const bool by_contacts = std::ranges::any_of(users_, [](const User& user) { return user.spec->contact_depth > 0; });
  if (scheme_->has_ghosts() || by_contacts) graph_.build(contacts_, scene_.bodies.size());
  for (User& user : users_) extract(user);
}

void World::extract(User& user) {
  const BodyId proxy = user.spec->proxy;
  Membership& now = user.membership;
  Box reach;  // of the members, until a sub-world hears again
  if (scheme_->has_sub_world()) {
    const Box box = selection_box(engine_->state(proxy).position, user.spec->box_half_m);
    engine_->overlap(box, scratch_);
    if (user.spec->contact_depth > 0) {
      add_neighbours(graph_, scene_.bodies, proxy, user.spec->contact_depth, scratch_);
    }
    select_members(scratch_, scene_.bodies, proxy, now);
    approach_.begin(horizon_s(user));
    reach = box;
    for (const BodyId id : now.members) reach.extend(approach_.inside(id, engine_->state(id), engine_->bounds(id)));
    engine_->overlap(reach, scratch_);
    select_fixed(scratch_, contacts_, scene_.bodies, now);
  } else {
    now.members.assign(1, proxy);
  }

  WorldFrame& frame = user.newest(stamp_);
  frame.user = UserId{static_cast<std::uint32_t>(&user - users_.data())};
  frame.stamp = stamp_;
  frame.stamp_s = time_s();
  frame.echoed_sent_ns = user.report.sent_ns;
  frame.echoed_stamp = user.report.stamp;
  frame.members = now.members;
  frame.fixed = now.fixed;
  extract_border(contacts_, now, frame.border);
  if (scheme_->has_ghosts()) {
    find_approaching(now, reach, frame.border);
    describe_outside(user, frame);
  }
  if (scheme_->replicates_peers()) list_peers(user, frame);
  list_unconfirmed(user, frame);
}

void World::find_approaching(const Membership& now, Box reach, std::vector<BorderPair>& border) {
  for (const BodyId id : approach_.touching(now, graph_, border)) {
    reach.extend(approach_.ghost(id, engine_->state(id), engine_->bounds(id)));
  }
  std::optional<Box> where = reach;
  while (where) {
    for (const Body& body : scene_.bodies) {
      if (!approach_.may_come(body.id)) continue;
      approach_.outside(body.id, motions_[index(body.id)].state, engine_->bounds(body.id), *where);
    }
    where = approach_.find(now, graph_, border);
  }
}

double World::horizon_s(const User& user) const {
  const std::uint64_t unheard = user.heard ? user.report.stamp - user.report.confirmed_stamp : 1;
  return scene_.settings.cycle_s() * static_cast<double>(1 + std::clamp<std::uint64_t>(unheard, 1, remembered_));
}

void World::describe_outside(const User& user, WorldFrame& frame) {
  const Membership& now = user.membership;
  modeller_.model(frame.border, {now, graph_, motions_, scene_.settings.cycle_s()}, frame.ghosts);
  islands_.begin(now.members);
  for (const Contact& c : contacts_) {
    if (!scene_.body(c.a).fixed() && !scene_.body(c.b).fixed()) islands_.join(c.a, c.b);
  }
  for (const BodyId id : now.members) {
    if (sharers(id) > 1) islands_.open(id);
  }
  islands_.labels(frame.islands);
}

void World::list_peers(const User& user, WorldFrame& frame) {
  frame.peers.clear();
  for (const User& peer : users_) {
    const UserSpec& spec = *peer.spec;
    if (&peer == &user || spec.device.kind != DeviceKind::impedance) continue;
    const HapticReport& report = peer.at(stamp_);
    if (!peer.heard || !std::ranges::binary_search(frame.members, spec.proxy)) continue;
    PeerDevice device{spec.proxy, report.device_pose, report.device_linear_velocity, report.device_angular_velocity};
    device.pose.position += (frame.stamp_s - report.stamp_s) * device.linear_velocity;
    frame.peers.push_back(device);
  }
}

double World::lead_s() const {
  if (!scheme_->has_ghosts()) return 0.0;
  return 0.5 * (engine_->part_s(scene_.settings.cycle_s() / substeps_) - scene_.settings.h_s);
}

BodyState World::told(BodyId id) const { return advanced(engine_->state(id), -lead_s()); }

void World::list_unconfirmed(const User& user, WorldFrame& frame) {
  // A body may have left and come back since the last frame that the haptic process confirmed: what counts as there is
  // what every frame since then lists. States go out for all that any of them lists.
  wanted_ = frame.members;
  const std::uint64_t confirmed = user.report.confirmed_stamp;
  const std::uint64_t oldest = std::max(confirmed, stamp_ >= remembered_ ? stamp_ - remembered_ + 1 : 0);
  const bool any_confirmed = user.heard && oldest < stamp_;
  frame.entering.clear();
  const auto list = [&](BodyId id) {
    bool there = any_confirmed;
    for (std::uint64_t j = oldest; j < stamp_ && there; ++j) there = names(user.frames[j % remembered_], id);
    if (!there) frame.entering.push_back({scene_.body(id), told(id)});
  };
  if (scheme_->has_sub_world()) {
    std::ranges::for_each(frame.members, list);
    std::ranges::for_each(frame.fixed, list);
    for (const GhostModel& ghost : frame.ghosts) list(ghost.outside);
  }
  for (const GhostModel& ghost : frame.ghosts) wanted_.push_back(ghost.outside);
  for (std::uint64_t j = oldest; j < stamp_; ++j) {
    const auto& past = user.frames[j % remembered_].members;
    wanted_.insert(wanted_.end(), past.begin(), past.end());
  }
  sort_unique(wanted_);
  frame.states.clear();
  for (const BodyId id : wanted_) frame.states.push_back({id, told(id)});
}

void World::account() {
  kinetic_j_ = potential_j_ = 0.0;
  const Vec3& gravity = scene_.settings.world.gravity;
  for (const Body& body : scene_.bodies) {
    if (body.fixed()) continue;
    const BodyState s = engine_->state(body.id);
    Motion& motion = motions_[index(body.id)];
    if (stamp_ > 0)
      motion.acceleration = (s.linear_velocity - motion.state.linear_velocity) / scene_.settings.cycle_s();
    motion.state = s;
    mix(hash_, s);
    finite_ = finite_ && subworld::finite(s);
    kinetic_j_ += kinetic_energy(body, s);
    if (body.gravity) potential_j_ -= body.mass * gravity.dot(s.position);
  }
  energy_j_[stamp_ % remembered_] = kinetic_j_ + potential_j_;
}

void World::balance() {
  // Energy and work of one stamp: the newest that all users have reported.
  double given_j = 0.0;
  for (const User& user : users_) {
    if (!user.heard || user.report.stamp != users_.front().report.stamp) return;
    given_j += user.report.device_work_j - user.report.coupling_energy_j;
  }
  if (users_.empty() || users_.front().report.stamp + remembered_ <= stamp_) return;
  const double energy_j = energy_j_[users_.front().report.stamp % remembered_];
  energy_excess_j_ = std::max(energy_excess_j_, energy_j - start_energy_j_ - given_j);
}

SceneDescription World::description(std::uint64_t settings_hash) const {
  SceneDescription description;
  description.name = scene_.name;
  description.settings_hash = settings_hash;
  description.users = static_cast<std::uint32_t>(users_.size());
  description.meshes = scene_.meshes;
  description.bodies = scene_.bodies;
  for (const Body& body : scene_.bodies) {
    description.states.push_back(engine_->contains(body.id) ? engine_->state(body.id) : scene_.initial[index(body.id)]);
  }
  return description;
}

void World::look(WorldView& view) const {
  view.stamp_s = time_s();
  view.states.resize(scene_.bodies.size());
  for (const Body& body : scene_.bodies) view.states[index(body.id)] = engine_->state(body.id);
  view.users.resize(users_.size());
  for (std::size_t u = 0; u < users_.size(); ++u) {
    const User& user = users_[u];
    UserView& seen = view.users[u];
    seen.user = UserId{static_cast<std::uint32_t>(u)};
    seen.proxy = user.spec->proxy;
    seen.members = user.membership.members;
    seen.border.clear();
    std::ranges::copy_if(user.newest(stamp_).border, std::back_inserter(seen.border), touches);
    seen.wrench = {user.report.impulse.force / scene_.settings.cycle_s(),
                   user.report.impulse.torque / scene_.settings.cycle_s()};
  }
}

}  // namespace subworld
