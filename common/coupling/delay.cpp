#include "coupling/delay.hpp"

#include <cmath>

namespace subworld {

namespace {

enum Direction : std::uint64_t { up, down };

/// Uniform in [0, 1). SplitMix64 (Steele, Lea, Flood 2014).
double uniform(std::uint64_t key) noexcept {
  std::uint64_t z = key + 0x9e3779b97f4a7c15ULL;
  z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27U)) * 0x94d049bb133111ebULL;
  return static_cast<double>((z ^ (z >> 31U)) >> 11U) * 0x1.0p-53;
}

}  // namespace

Delay::Delay(const Settings& settings, int lead_cycles, std::uint32_t user) noexcept
    : settings_(settings.delay),
      h_s_(settings.h_s),
      shortest_cycle_s_(settings.shortest_cycle_s()),
      lead_(static_cast<std::uint64_t>(lead_cycles)),
      user_(user) {}

std::uint64_t Delay::steps(double delay_s, std::uint64_t direction, std::uint64_t stamp) const noexcept {
  if (settings_.jitter_s > 0.0) {
    const std::uint64_t key = ((settings_.seed * 64 + user_) * 2 + direction) * 0x100000001b3ULL + stamp;
    delay_s += settings_.jitter_s * uniform(key);
  }
  return static_cast<std::uint64_t>(std::ceil(delay_s / h_s_ - 1e-9));
}

std::uint64_t Delay::frame_due(std::uint64_t stamp, const Timetable& timetable) const noexcept {
  if (stamp == 0) return 0;
  const std::uint64_t waiting = lead_ > 0 ? steps(settings_.up_s, up, stamp) : 0;
  return timetable.start(stamp + lead_) + waiting + steps(settings_.down_s, down, stamp);
}

bool Delay::report_due(std::uint64_t stamp, std::uint64_t world, const Timetable& timetable) const noexcept {
  if (lead_ > 0 || stamp == 0) return stamp <= world + lead_;
  return timetable.start(stamp) + steps(settings_.up_s, up, stamp) <= timetable.start(world);
}

std::uint64_t Delay::longest_cycles() const noexcept {
  const double both_s = settings_.up_s + settings_.down_s + 2.0 * settings_.jitter_s;
  return lead_ + 1 + static_cast<std::uint64_t>(std::ceil(both_s / shortest_cycle_s_));
}

}  // namespace subworld
