#include "world_sim/world.hpp"

#include "coupling/border.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

namespace subworld {

namespace {

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
