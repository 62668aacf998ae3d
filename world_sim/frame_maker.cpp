#include "world_sim/frame_maker.hpp"

#include "coupling/plan.hpp"
#include "coupling/select/border.hpp"
#include "coupling/select/swept_bounds.hpp"
#include "coupling/sync/blend.hpp"
#include "model/sorted.hpp"

#include <algorithm>
#include <utility>

namespace subworld {

namespace {

/// A frame without a base: one who comes late, or has lost its base, knows the world from it.
constexpr std::uint64_t kCompleteEvery_cycles = 128;

/// Slower motion cannot be felt, m/s.
constexpr double kStill_m_s = 5e-3;

void sort_unique(std::vector<BodyId>& ids) {
  std::ranges::sort(ids);
  const auto twice = std::ranges::unique(ids);
  ids.erase(twice.begin(), twice.end());
}

}  // namespace

FrameMaker::FrameMaker(const Scene& scene, const Scheme& scheme, WorldSide& side, std::uint64_t remembered_cycles)
    : scene_(scene),
      scheme_(scheme),
      remembered_(remembered_cycles),
      users_(static_cast<std::size_t>(scene.settings.users)),
      side_(side),
      peers_(scene),
      user_of_(scene.bodies.size()),
      holders_(scene.bodies.size()),
      visited_(scene.bodies.size()),
      budget_(scene),
      tells_all_pairs_(!enabled(scene, Optimisation::pairs)),
      operators_j_(users_.size(), 0.0),
      work_j_(users_.size(), 0.0),
      suppression_(scene, scheme),
      may_suppress_(enabled(scene, Optimisation::suppression)),
      sends_changes_(enabled(scene, Optimisation::changes)) {
  const Settings& s = scene.settings;
  scratch_.reserve(scene.bodies.size() + remembered_ * kUsualMembers);
  before_.reserve(kUsualMembers);
  contacts_.reserve(kUsualContacts);
  pulls_.reserve(users_.size());
  for (std::size_t u = 0; u < users_.size(); ++u) {
    User& user = users_[u];
    user.spec = &scene.users[u];
    proxies_.push_back(user.spec->proxy);
    user_of_[index(user.spec->proxy)] = static_cast<std::uint8_t>(u);
    user.budget = {.limit_s = user.spec->budget_ratio * s.h_s,
                   .cost = engine_cost(s.haptic).step(s.h_s),
                   .simulates_border = scheme.properties.simulates_border};
    user.frames.resize(remembered_);
    user.outside.resize(remembered_);
    user.border.contacts.reserve(4 * kUsualMembers);
    for (std::vector<OutsideBody>& list : user.outside) list.reserve(kUsualMembers);
    user.border.outside.reserve(kUsualMembers);
    user.border.pushing.reserve(users_.size());
    user.near.reserve(kUsualMembers);
    if (s.mode == Mode::realtime) {
      for (WorldFrame& frame : user.frames) reserve(frame, kUsualMembers);
    }
  }
}

void FrameMaker::make(const WorldNow& of_world, std::span<const UserLink> links, double offset_s) {
  note_work(links);
  pulls_.clear();
  for (const UserLink& link : links) {
    const bool spring = link.holds() || link.spec().device.kind == DeviceKind::impedance;
    if (link.holds() || link.drives()) pulls_.push_back({link.spec().proxy, link.wrench().force, spring});
  }
  WorldNow now = of_world;
  now.pulls = pulls_;
  const std::function<bool(BodyId)> shared = [this](BodyId id) { return holders(id) > 1; };
  if (users_.size() > 1) begin_peers(now, links);
  if (scheme_.properties.has_sub_worlds) side_.begin(now);
  for (std::size_t u = 0; u < users_.size(); ++u) {
    User& user = users_[u];
    const ReportInbox& reports = links[u].reports();
    if (!reports.waits_for_frame(now.stamp)) {
      frame(u, now.stamp) = frame(u, now.stamp - 1);  // what the sub-world has
      user.outside[now.stamp % remembered_] = user.border.outside;
      continue;
    }
    const double until_heard_s = horizon_s(now, links[u]);
    before_ = user.membership.members;
    const Box reach = select(user, now, until_heard_s);
    for (const BodyId id : before_) --holders_[index(id)];
    for (const BodyId id : user.membership.members) ++holders_[index(id)];
    WorldFrame& out = frame(u, now.stamp);
    out.user = UserId{static_cast<std::uint32_t>(u)};
    out.stamp = now.stamp;
    out.stamp_s = now.stamp_s;
    out.cycle_s = now.cycle_s;
    out.ratio = now.timetable.ratio(now.stamp);
    out.planned = now.timetable.newest();
    out.echoed_sent_ns = reports.heard() ? reports.newest().sent_ns : 0;
    out.echoed_stamp = reports.newest().stamp;
    out.base_stamp.reset();
    const bool complete = now.stamp % kCompleteEvery_cycles == 0;
    if (sends_changes_ && reports.heard() && !complete) out.base_stamp = reports.newest().confirmed_stamp;
    out.members = user.membership.members;
    out.fixed = user.membership.fixed;
    out.broken_joints = broken_joints_;
    if (scheme_.properties.has_sub_worlds)
      side_.extract(now, {user.membership, reach, until_heard_s, shared}, user.border, out);
    user.outside[now.stamp % remembered_] = user.border.outside;
    list_peers(user, now, links, out);
    count_energy(user, now, out);
    count_outside_work(user, out);
    list_unconfirmed(user, now, links[u], offset_s, out);
    tell_border(user, now, links[u], out);
    out.suppression.reset();
    const bool alone =
        out.states.size() == 1 && out.entering.empty() && user.border.outside.empty() && user.border.contacts.empty();
    if (may_suppress_ && reports.heard() && alone) out.suppression = suppression_.find(*user.spec, now);
  }
}

Box FrameMaker::select(User& user, const WorldNow& now, double horizon_s) {
  const UserSpec& spec = *user.spec;
  Membership& chosen = user.membership;
  if (!scheme_.properties.has_sub_worlds) {
    scratch_.clear();
    find_peers(user, now, horizon_s, scratch_);
    chosen.members.assign(1, spec.proxy);
    return {};
  }
  const auto bounds = [&now](BodyId id) { return now.engine.bounds(id); };
  const Box box = selection_box(now.engine.state(spec.proxy).position, spec.box_half_m);
  scratch_.clear();
  if (spec.selection != Selection::contacts) now.engine.overlap(box, scratch_);
  if (spec.contact_depth > 0) add_neighbours(now.graph, scene_.bodies, spec.proxy, spec.contact_depth, scratch_);
  const double gravity_m_s2 = scene_.settings.world.gravity.norm();
  before_.clear();  // only who is felt counts for a scheme that does not replicate peers
  find_peers(user, now, horizon_s, scheme_.properties.replicates_peers ? scratch_ : before_);
  before_ = chosen.members;
  select_members(scratch_, scene_.bodies, spec.proxy, chosen);
  budget_.mechanisms().complete(chosen.members);
  if (spec.selection == Selection::budget) {
    Budget budget = user.budget;
    budget.limit_s /= user.selection.cost_factor;
    const auto peers = std::span(user.felt).first(scheme_.properties.replicates_peers ? user.felt.size() : 0);
    budget_.limit(spec.proxy, before_, now.graph, now.cycle_s, peers, bounds, budget, chosen.members);
    user.selection.expected_s = budget_.cost_s();
    user.selection.omitted = budget_.omitted();
  }
  Box reach = box;
  for (const BodyId id : chosen.members) {
    reach.extend(swept_bounds(now.engine.state(id), bounds(id), gravity_m_s2, horizon_s));
  }
  now.engine.overlap(reach, scratch_);
  now.graph.contacts_of(chosen.members, contacts_);
  select_fixed(scratch_, contacts_, scene_.bodies, chosen);
  return reach;
}

bool FrameMaker::border_is_felt(const WorldNow& now, double until_s) {
  const auto moves = [&](BodyId id) { return now.motions[index(id)].state.linear_velocity.norm() > kStill_m_s; };
  for (User& user : users_) {
    if (user.border.contacts.empty()) continue;
    const BodyId proxy = user.spec->proxy;
    const Box reach = swept_bounds(now.motions[index(proxy)].state, now.engine.bounds(proxy),
                                   scene_.settings.world.gravity.norm(), until_s);
    now.engine.overlap(reach, scratch_);
    const auto is_other = [&](BodyId id) { return id != proxy && !scene_.body(id).fixed(); };
    const WorldFrame& last = user.frames[(now.stamp == 0 ? 0 : now.stamp - 1) % remembered_];
    if (std::ranges::any_of(scratch_, is_other) && std::ranges::any_of(last.members, moves)) return true;
  }
  return false;
}

double FrameMaker::horizon_s(const WorldNow& now, const UserLink& link) const {
  const HapticReport& newest = link.reports().newest();
  const std::uint64_t unheard = link.reports().heard() ? newest.stamp - newest.confirmed_stamp : 1;
  const std::uint64_t until = now.stamp + 1 + std::clamp<std::uint64_t>(unheard, 1, remembered_);
  return scene_.settings.h_s * static_cast<double>(now.timetable.start(until) - now.timetable.start(now.stamp));
}

std::uint64_t FrameMaker::first_unconfirmed(const WorldNow& now, const UserLink& link) const noexcept {
  const std::uint64_t first_remembered = now.stamp >= remembered_ ? now.stamp - remembered_ + 1 : 0;
  return std::max(link.reports().newest().confirmed_stamp, first_remembered);
}

void FrameMaker::tell_border(const User& user, const WorldNow& now, const UserLink& link, WorldFrame& frame) {
  frame.border_contacts = static_cast<std::uint32_t>(std::ranges::count_if(user.border.contacts, touches));
  border_bodies(user.border.contacts, scratch_);
  frame.border_bodies = static_cast<std::uint32_t>(scratch_.size());
  frame.border = user.border.contacts;
  if (tells_all_pairs_) return;
  // An outside body begins clear of what it touches; then the scheme's part of the frame is enough.
  const std::uint64_t oldest = first_unconfirmed(now, link);
  const bool any_confirmed = link.reports().heard() && oldest < now.stamp;
  const auto begins = [&](const OutsideBody& body) {
    const auto is_as_before = [&](std::uint64_t stamp) {
      const std::vector<OutsideBody>& outside = user.outside[stamp % remembered_];
      const auto before = find_sorted(outside, body.id, &OutsideBody::id);
      return before != outside.end() && before->form == body.form;
    };
    bool known = any_confirmed;
    for (std::uint64_t j = oldest; j < now.stamp && known; ++j) known = is_as_before(j);
    return !known;
  };
  scratch_.clear();
  for (const OutsideBody& body : user.border.outside) {
    if (begins(body)) scratch_.push_back(body.id);
  }
  std::erase_if(frame.border,
                [&](const BoundaryContact& p) { return !std::ranges::binary_search(scratch_, p.outside); });
}

void FrameMaker::list_unconfirmed(const User& user, const WorldNow& now, const UserLink& link, double offset_s,
                                  WorldFrame& frame) {
  const auto published_state = [&](BodyId id) { return advanced(now.engine.state(id), offset_s); };
  const auto past = [&](std::uint64_t stamp) -> const WorldFrame& { return user.frames[stamp % remembered_]; };
  // Whether a sub-world that has taken the frame of a stamp holds the body, in whatever role.
  const auto names = [&](std::uint64_t stamp, BodyId id) {
    return std::ranges::binary_search(past(stamp).members, id) || std::ranges::binary_search(past(stamp).fixed, id) ||
           std::ranges::binary_search(user.outside[stamp % remembered_], id, {}, &OutsideBody::id);
  };
  // A body may have left and come back since the last frame that the haptic process confirmed: what counts as there is
  // what every frame since then lists. States go out for all that any of them lists.
  std::vector<BodyId>& wanted = scratch_;
  wanted = frame.members;
  const std::uint64_t oldest = first_unconfirmed(now, link);
  const bool any_confirmed = link.reports().heard() && oldest < now.stamp;
  frame.entering.clear();
  const auto list = [&](BodyId id) {
    bool there = any_confirmed;
    for (std::uint64_t j = oldest; j < now.stamp && there; ++j) there = names(j, id);
    if (!there) frame.entering.push_back({nameless(scene_.body(id)), published_state(id)});
  };
  if (scheme_.properties.has_sub_worlds) {
    std::ranges::for_each(frame.members, list);
    std::ranges::for_each(frame.fixed, list);
    for (const OutsideBody& body : user.border.outside) list(body.id);
  }
  for (const OutsideBody& body : user.border.outside) wanted.push_back(body.id);
  for (std::uint64_t j = oldest; j < now.stamp; ++j) {
    wanted.insert(wanted.end(), past(j).members.begin(), past(j).members.end());
  }
  sort_unique(wanted);
  frame.states.clear();
  for (const BodyId id : wanted) frame.states.push_back({id, published_state(id)});
}

}  // namespace subworld
