#include "world_sim/world.hpp"

#include "coupling/border.hpp"
#include "coupling/virtual_coupling.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

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

double kinetic_energy(const Body& body, const BodyState& s) noexcept {
  const Vec3 spin = s.orientation.conjugate() * s.angular_velocity;
  return 0.5 * (body.mass * s.linear_velocity.squaredNorm() + spin.cwiseProduct(body.inertia).dot(spin));
}

ForceLimits limits_of(const DeviceSpec& device) noexcept {
  return {device.force_limit_n, device.torque_limit_n_m, device.degrees_of_freedom == 6};
}

void sort_unique(std::vector<BodyId>& ids) {
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
}

}  // namespace

World::World(const Scene& scene)
    : scene_(scene),
      scheme_(make_scheme(scene.settings)),
      engine_(make_engine(scene.settings.world, scene.meshes)),
      users_(static_cast<std::size_t>(scene.settings.users)),
      hash_(kHashSeed) {
  for (const Body& body : scene.bodies) engine_->add(body, scene.initial[index(body.id)]);
  for (std::size_t u = 0; u < users_.size(); ++u) {
    users_[u].spec = &scene.users[u];
    std::vector<BodyId> peers;
    for (std::size_t p = 0; p < users_.size(); ++p) {
      if (p != u) peers.push_back(scene.users[p].proxy);
    }
    users_[u].synchroniser = std::make_unique<Synchroniser>(*scheme_, scene.users[u].proxy, std::move(peers));
    for (WorldFrame& frame : users_[u].frames) reserve(frame, kUsualMembers);
    for (HapticReport& report : users_[u].inbox) reserve(report, kUsualMembers);
    reserve(users_[u].report, kUsualMembers);
    extract(users_[u]);
  }
}

bool World::settle(const std::function<bool(double)>& progress) {
  const double dt = scene_.settings.settle_step_s;
  const auto steps = static_cast<int>(std::lround(scene_.settings.settle_s / dt));
  for (int i = 0; i < steps; ++i) {
    for (const User& user : users_) {
      const BodyId proxy = user.spec->proxy;
      const BodyState& start = scene_.initial[index(proxy)];
      const DevicePose device{{start.position, start.orientation}, Vec3::Zero(), Vec3::Zero()};
      const ImplicitStep coupling = implicit_step(user.spec->coupling, limits_of(user.spec->device), scene_.body(proxy),
                                                  engine_->state(proxy), device, dt);
      engine_->set_inertia(proxy, coupling.mass, coupling.inertia);
      engine_->set_state(proxy, coupling.start);
      engine_->apply_force(proxy, coupling.wrench.force, coupling.wrench.torque);
    }
    engine_->step(dt);
    if (!progress(static_cast<double>(i + 1) / steps)) return false;
  }
  for (User& user : users_) {
    const Body& proxy = scene_.body(user.spec->proxy);
    engine_->set_inertia(proxy.id, proxy.mass, proxy.inertia);
    extract(user);
  }
  account();
  start_energy_j_ = kinetic_j_ + potential_j_;
  energy_excess_j_ = 0.0;
  return true;
}

bool World::receive(HapticReport&& report) {
  if (index(report.user) >= users_.size()) return false;
  User& user = users_[index(report.user)];
  if (user.heard && report.stamp <= user.report.stamp) return false;
  if (report.stamp > stamp_ + kRememberedCycles / 2 || report.stamp + kRememberedCycles <= stamp_) return false;
  const std::size_t slot = report.stamp % kRememberedCycles;
  user.inbox[slot] = std::move(report);
  user.waiting[slot] = true;
  return true;
}

void World::synchronise() {
  const std::uint64_t oldest = stamp_ >= kRememberedCycles ? stamp_ - kRememberedCycles + 1 : 0;
  for (User& user : users_) {
    for (std::uint64_t j = oldest; j <= stamp_; ++j) {
      const std::size_t slot = j % kRememberedCycles;
      if (!user.waiting[slot] || user.inbox[slot].stamp != j) continue;
      user.waiting[slot] = false;
      if (user.heard && j <= user.report.stamp) continue;
      if (scheme_->has_sub_world() && j > 0) apply(user, user.inbox[slot]);
      std::swap(user.report, user.inbox[slot]);
      user.heard = true;
    }
  }
}

void World::apply(User& user, const HapticReport& report) {
  const WorldFrame& said = user.frames[report.stamp % kRememberedCycles];
  if (said.stamp != report.stamp) return;
  for (const PairShift& pair : user.synchroniser->synchronise(said, report)) {
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

void World::drive_proxies() {
  const double cycle_s = scene_.settings.cycle_s();
  for (const User& user : users_) {
    if (!user.heard) continue;
    const BodyId proxy = user.spec->proxy;
    const ProxyDrive drive = scheme_->drive(*user.spec, user.report, cycle_s);
    if (drive.device) {
      const ImplicitStep coupling = implicit_step(user.spec->coupling, limits_of(user.spec->device), scene_.body(proxy),
                                                  engine_->state(proxy), *drive.device, cycle_s);
      engine_->set_inertia(proxy, coupling.mass, coupling.inertia);
      engine_->set_state(proxy, coupling.start);
      engine_->apply_force(proxy, coupling.wrench.force, coupling.wrench.torque);
    }
    engine_->apply_force(proxy, drive.wrench.force, drive.wrench.torque);
  }
}

void World::step() {
  synchronise();
  drive_proxies();
  engine_->step(scene_.settings.cycle_s());
  ++stamp_;
  account();
  for (User& user : users_) extract(user);
}

void World::extract(User& user) {
  const BodyId proxy = user.spec->proxy;
  Membership& now = user.membership;
  if (scheme_->has_sub_world()) {
    const Box box = selection_box(engine_->state(proxy).position, user.spec->box_half_m);
    engine_->overlap(box, scratch_);
    select_members(scratch_, scene_.bodies, proxy, now);
    Box reach = box;
    for (const BodyId id : now.members) reach.extend(engine_->bounds(id));
    engine_->overlap(reach, scratch_);
    select_fixed(scratch_, scene_.bodies, now);
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
  extract_border(engine_->contacts(), now, frame.border);
  list_unconfirmed(user, frame);
}

void World::list_unconfirmed(User& user, WorldFrame& frame) {
  // A body may have left and come back since the last frame that the haptic process confirmed: what counts as there is
  // what every frame since then lists. States go out for all that any of them lists.
  wanted_ = frame.members;
  const std::uint64_t confirmed = user.report.confirmed_stamp;
  const std::uint64_t oldest = std::max(confirmed, stamp_ >= kRememberedCycles ? stamp_ - kRememberedCycles + 1 : 0);
  const bool any_confirmed = user.heard && oldest < stamp_;
  frame.entering.clear();
  const auto list = [&](const std::vector<BodyId>& ids, auto member) {
    for (const BodyId id : ids) {
      bool there = any_confirmed;
      for (std::uint64_t j = oldest; j < stamp_ && there; ++j) {
        const std::vector<BodyId>& past = user.frames[j % kRememberedCycles].*member;
        there = std::binary_search(past.begin(), past.end(), id);
      }
      if (!there) frame.entering.push_back({scene_.body(id), engine_->state(id)});
    }
  };
  if (scheme_->has_sub_world()) {
    list(frame.members, &WorldFrame::members);
    list(frame.fixed, &WorldFrame::fixed);
  }
  for (std::uint64_t j = oldest; j < stamp_; ++j) {
    const auto& past = user.frames[j % kRememberedCycles].members;
    wanted_.insert(wanted_.end(), past.begin(), past.end());
  }
  sort_unique(wanted_);
  frame.states.clear();
  for (const BodyId id : wanted_) frame.states.push_back({id, engine_->state(id)});
}

void World::account() {
  kinetic_j_ = potential_j_ = 0.0;
  const Vec3& gravity = scene_.settings.world.gravity;
  for (const Body& body : scene_.bodies) {
    if (body.fixed()) continue;
    const BodyState s = engine_->state(body.id);
    mix(hash_, s);
    finite_ = finite_ && subworld::finite(s);
    kinetic_j_ += kinetic_energy(body, s);
    if (body.gravity) potential_j_ -= body.mass * gravity.dot(s.position);
  }
  double given_j = 0.0;
  for (const User& user : users_) given_j += user.report.device_work_j - user.report.coupling_energy_j;
  energy_excess_j_ = std::max(energy_excess_j_, kinetic_j_ + potential_j_ - start_energy_j_ - given_j);
}

SceneDescription World::description(std::uint64_t settings_hash) const {
  SceneDescription description;
  description.name = scene_.name;
  description.settings_hash = settings_hash;
  description.meshes = scene_.meshes;
  description.bodies = scene_.bodies;
  for (const Body& body : scene_.bodies) description.states.push_back(engine_->state(body.id));
  return description;
}

void World::snapshot(bool complete, WorldSnapshot& out) {
  shown_.resize(scene_.bodies.size());
  out.stamp_s = time_s();
  out.moved.clear();
  for (const Body& body : scene_.bodies) {
    const BodyState s = engine_->state(body.id);
    BodyState& shown = shown_[index(body.id)];
    if (!complete && s.position == shown.position && s.orientation.coeffs() == shown.orientation.coeffs()) continue;
    shown = s;
    out.moved.push_back({body.id, s});
  }
  out.users.resize(users_.size());
  for (std::size_t u = 0; u < users_.size(); ++u) {
    User& user = users_[u];
    UserView& view = out.users[u];
    view.user = UserId{static_cast<std::uint32_t>(u)};
    view.proxy = user.spec->proxy;
    view.members = user.membership.members;
    view.border = user.newest(stamp_).border;
    view.wrench = {user.report.impulse.force / scene_.settings.cycle_s(),
                   user.report.impulse.torque / scene_.settings.cycle_s()};
  }
}

}  // namespace subworld
