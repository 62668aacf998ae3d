#include "world_sim/suppression_finder.hpp"

#include "coupling/select/selection.hpp"
#include "coupling/sync/synchroniser.hpp"
#include "model/shapes/reach.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

void SuppressionFinder::look_at_others(BodyId proxy, const WorldNow& now) {
  others_.ids.assign(now.engine.awake().begin(), now.engine.awake().end());
  std::erase(others_.ids, proxy);
  double fastest_m_s = 0.0, fastest_rad_s = 0.0;
  others_.longest_arm_m = 0.0;
  for (const BodyId id : others_.ids) {
    const BodyState& state = now.motions[index(id)].state;
    fastest_m_s = std::max(fastest_m_s, state.linear_velocity.norm());
    fastest_rad_s = std::max(fastest_rad_s, state.angular_velocity.norm());
    others_.longest_arm_m = std::max(others_.longest_arm_m, arm_m(now.engine.bounds(id)));
  }
  others_.fastest.linear_velocity = kHit * fastest_m_s * Vec3::UnitX();
  others_.fastest.angular_velocity = kHit * fastest_rad_s * Vec3::UnitX();
}

void SuppressionFinder::list_obstacles(const Box& place, double time_s, const WorldNow& now) {
  obstacles_.clear();
  double pushed_m = 0.0;  // what sleeps
  if (!others_.ids.empty()) {
    const double gravity_m_s2 = scene_.settings.world.gravity.norm();
    const double comes_m = reach_m(others_.fastest, others_.longest_arm_m, gravity_m_s2, time_s);
    now.engine.asleep_in(place.grown(comes_m), asleep_);
    const bool any_near = !asleep_.empty();
    for (const BodyId id : others_.ids) {
      obstacles_.push_back(now.engine.bounds(id).grown(comes_m));
      if (!any_near || pushed_m > 0.0) continue;
      now.engine.asleep_in(obstacles_.back(), asleep_);
      if (!asleep_.empty()) pushed_m = comes_m;
    }
  }
  now.engine.asleep_in(place.grown(pushed_m), asleep_);
  for (const BodyId id : asleep_) obstacles_.push_back(now.engine.bounds(id).grown(pushed_m));
}

std::optional<Suppression> SuppressionFinder::find(const UserSpec& user, const WorldNow& now) {
  const Settings& s = scene_.settings;
  const double cycle_s = s.h_s * now.timetable.ratio(now.stamp);
  const double ahead_s = looked_ahead_s(s, scheme_, cycle_s);
  const BodyState proxy = now.engine.state(user.proxy);
  const Box reach = operator_reach(now.engine.bounds(user.proxy), proxy, ahead_s);
  const Box around = selection_box(proxy.position, user.box_half_m);
  look_at_others(user.proxy, now);
  const double left_cycles = std::max(0.0, std::floor((s.duration_s - now.stamp_s) / cycle_s + 0.5));
  const auto shortest = static_cast<std::uint64_t>(scheme_.properties.lead_cycles) + 2;
  for (auto cycles = std::min(kMostSuppressedCycles, static_cast<std::uint64_t>(left_cycles)); cycles >= shortest;
       cycles /= 2) {
    list_obstacles(around, static_cast<double>(cycles) * cycle_s + ahead_s, now);
    const Box place = free_place(around, reach, obstacles_);
    if (place.holds(reach)) return Suppression{now.stamp + cycles, place};
  }
  return {};
}

}  // namespace subworld
