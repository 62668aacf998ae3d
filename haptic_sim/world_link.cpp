#include "haptic_sim/world_link.hpp"

#include "coupling/plan.hpp"
#include "coupling/sync/synchroniser.hpp"
#include "model/shapes/reach.hpp"
#include "model/shapes/shape_extent.hpp"

#include <algorithm>

namespace subworld {

namespace {

constexpr std::uint64_t kNoStamp = ~std::uint64_t{0};  ///< of a report that was not made

}  // namespace

WorldLink::WorldLink(const Scene& scene, const Scheme& scheme, std::size_t user)
    : scene_(scene),
      scheme_(scheme),
      user_(static_cast<std::uint32_t>(user)),
      reports_device_(!enabled(scene, Optimisation::device)),
      sends_changes_(enabled(scene, Optimisation::changes)),
      omits_overruled_(enabled(scene, Optimisation::overruled, user)),
      may_suppress_(enabled(scene, Optimisation::suppression)),
      suppression_(scheme.properties.lead_cycles),
      reports_(remembered_cycles(scene.settings, scheme)) {
  if (scene.settings.mode != Mode::realtime) return;
  for (HapticReport& report : reports_) reserve(report, kUsualMembers);
}

bool WorldLink::knows(const WorldFrame& frame) const noexcept {
  const auto in_scene = [&](BodyId id) { return index(id) < scene_.bodies.size(); };
  return std::ranges::all_of(frame.members, in_scene) && std::ranges::all_of(frame.fixed, in_scene) &&
         std::ranges::all_of(frame.peers, in_scene, &PeerDevice::proxy) &&
         std::ranges::all_of(frame.entering, in_scene, [](const EnteringBody& e) { return e.body.id; }) &&
         scheme_.accepts(frame, scene_);
}

std::optional<std::uint64_t> WorldLink::missing_before(const WorldFrame& frame) const noexcept {
  if (!knows(frame) || (framed() && frame.stamp <= *frame_stamp_)) return {};
  return framed() ? frame.stamp - *frame_stamp_ - 1 : 0;
}

void WorldLink::use(const WorldFrame& frame) noexcept {
  frame_stamp_ = frame.stamp;
  if (frame.echoed_sent_ns != 0) known_stamp_ = frame.echoed_stamp;
  if (may_suppress_) suppression_.begin(frame);
}

void WorldLink::restart(const WorldFrame& frame) noexcept {
  started_stamp_ = frame.stamp;
  known_stamp_.reset();
  suppression_.forget();
  for (HapticReport& said : reports_) said.stamp = kNoStamp;
  use(frame);
}

bool WorldLink::passes_frame(std::uint64_t stamp) noexcept {
  if (!suppression_.lacks_frame(stamp)) return false;
  frame_stamp_ = stamp;
  return true;
}

HapticReport& WorldLink::report(std::uint64_t stamp) noexcept {
  suppression_.end(stamp);
  HapticReport& report = reports_[stamp % reports_.size()];
  report.user = UserId{user_};
  report.stamp = stamp;
  report.confirmed_stamp = frame_stamp_.value_or(0);
  report.started_stamp = started_stamp_;
  report.base_stamp = sends_changes_ ? known_stamp_ : std::nullopt;
  report.omits_overruled = omits_overruled_;
  report.device.reset();
  if (reports_device_) report.device.emplace();
  report.members.clear();
  report.islands.clear();
  return report;
}

const HapticReport* WorldLink::report_of(std::uint64_t stamp) const noexcept {
  const HapticReport& mine = reports_[stamp % reports_.size()];
  return framed() && mine.stamp == stamp ? &mine : nullptr;
}

bool WorldLink::suppresses(std::uint64_t stamp, const BodyState& proxy, double cycle_s) const {
  if (!may_suppress_ || !suppression_.may_lack_report(stamp)) return false;
  const Box there = bounds(scene_.body(scene_.users[user_].proxy).shape, proxy, scene_.meshes);
  return suppression_.place().holds(operator_reach(there, proxy, looked_ahead_s(scene_.settings, scheme_, cycle_s)));
}

}  // namespace subworld
