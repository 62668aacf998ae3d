#include "coupling/messages/delay.hpp"

#include <cmath>

namespace subworld {

Delay::Delay(const Settings& settings, int lead_cycles, std::uint32_t user) noexcept
    : journey_(settings.delay, user),
      settings_(settings.delay),
      h_s_(settings.h_s),
      shortest_cycle_s_(settings.shortest_cycle_s()),
      lead_(static_cast<std::uint64_t>(lead_cycles)) {}

std::uint64_t Delay::steps(Direction direction, std::uint64_t stamp) const noexcept {
  return journey_steps(journey_, direction, stamp, h_s_) +
         journey_.losses(direction, stamp) * static_cast<std::uint64_t>(std::ceil(journey_.repeat_s() / h_s_));
}

std::uint64_t Delay::frame_due(std::uint64_t stamp, const Timetable& timetable) const noexcept {
  if (stamp == 0) return 0;
  const std::uint64_t waiting = lead_ > 0 ? steps(Direction::up, stamp) : 0;
  return timetable.start(stamp + lead_) + waiting + steps(Direction::down, stamp);
}

bool Delay::report_due(std::uint64_t stamp, std::uint64_t world, const Timetable& timetable) const noexcept {
  if (lead_ > 0 || stamp == 0) return stamp <= world + lead_;
  return timetable.start(stamp) + steps(Direction::up, stamp) <= timetable.start(world);
}

std::uint64_t Delay::longest_cycles() const noexcept {
  const double repeats_s =
      settings_.loss_ratio > 0.0 ? static_cast<double>(2 * Journey::kMostLosses) * journey_.repeat_s() : 0.0;
  const double both_s = settings_.up_s + settings_.down_s + 2.0 * settings_.jitter_s + repeats_s;
  return lead_ + 1 + static_cast<std::uint64_t>(std::ceil(both_s / shortest_cycle_s_));
}

}  // namespace subworld
