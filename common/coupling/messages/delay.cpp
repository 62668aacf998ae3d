#include "coupling/messages/delay.hpp"

#include "model/hash.hpp"

#include <cmath>

namespace subworld {

namespace {

/// After this time a lost message that is sent reliably is asked for again, on top of the way there and back.
constexpr double kHeartbeat_s = 0.02;
/// Of one message; then it arrives.
constexpr std::uint64_t kMostLosses = 4;
/// Draws for losses, apart from those for jitter.
constexpr std::uint64_t kLoss = 0x5bd1e995;

/// Uniform in [0, 1).
double uniform(std::uint64_t key) noexcept { return static_cast<double>(random_bits(key) >> 11U) * 0x1.0p-53; }

}  // namespace

double Journey::delay_s(Direction direction) const noexcept {
  switch (direction) {
    case Direction::up:
      return settings_.up_s;
    case Direction::down:
      return settings_.down_s;
    case Direction::from_device:
      return settings_.from_device_s;
    case Direction::from_peer:
      return settings_.from_device_s + settings_.down_s;
    case Direction::to_device:
      break;
  }
  return settings_.to_device_s;
}

std::uint64_t Journey::steps(Direction direction, std::uint64_t number) const noexcept {
  double delay = delay_s(direction);
  if (settings_.jitter_s > 0.0) {
    const std::uint64_t key =
        ((settings_.seed * 64 + user_) * 2 + static_cast<std::uint64_t>(direction)) * kHashPrime + number;
    delay += settings_.jitter_s * uniform(key);
  }
  return static_cast<std::uint64_t>(std::ceil(delay / h_s_ - 1e-9));
}

bool Journey::is_lost(Direction direction, std::uint64_t number, std::uint64_t attempt) const noexcept {
  if (settings_.loss_ratio <= 0.0) return false;
  const std::uint64_t stream = (settings_.seed * 64 + user_) * 4 + static_cast<std::uint64_t>(direction);
  return uniform(((stream + kLoss) * 8 + attempt) * kHashPrime + number) < settings_.loss_ratio;
}

double Journey::longest_s(Direction direction) const noexcept { return delay_s(direction) + settings_.jitter_s; }

Delay::Delay(const Settings& settings, int lead_cycles, std::uint32_t user) noexcept
    : journey_(settings, user),
      settings_(settings.delay),
      h_s_(settings.h_s),
      shortest_cycle_s_(settings.shortest_cycle_s()),
      lead_(static_cast<std::uint64_t>(lead_cycles)) {}

std::uint64_t Delay::steps(Direction direction, std::uint64_t stamp) const noexcept {
  std::uint64_t losses = 0;
  while (losses < kMostLosses && journey_.is_lost(direction, stamp, losses)) ++losses;
  return journey_.steps(direction, stamp) +
         losses * static_cast<std::uint64_t>(std::ceil((settings_.up_s + settings_.down_s + kHeartbeat_s) / h_s_));
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
  const double way_s = settings_.up_s + settings_.down_s;
  const double repeats_s =
      settings_.loss_ratio > 0.0 ? static_cast<double>(2 * kMostLosses) * (way_s + kHeartbeat_s) : 0.0;
  const double both_s = way_s + 2.0 * settings_.jitter_s + repeats_s;
  return lead_ + 1 + static_cast<std::uint64_t>(std::ceil(both_s / shortest_cycle_s_));
}

}  // namespace subworld
