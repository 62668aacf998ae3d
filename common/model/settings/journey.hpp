#pragma once

#include "model/hash.hpp"
#include "model/scene/scene.hpp"

#include <cmath>
#include <cstdint>

namespace subworld {

/// `from_peer`: from the device of another user to the sub-world, one hop of the network beyond that device's own link.
enum class Direction : std::uint8_t { up, down, from_device, to_device, from_peer };

/// What becomes of one message of a user under artificial delay, jitter and loss: a pure function, so that both sides
/// know it and a run in lock-step repeats bit by bit.
class Journey {
 public:
  Journey(const DelaySettings& settings, std::uint32_t user) noexcept : settings_(settings), user_(user) {}

  /// Of the message of this number.
  [[nodiscard]] double delay_s(Direction direction, std::uint64_t number) const noexcept {
    if (settings_.jitter_s <= 0.0 || is_local(direction)) return constant_s(direction);
    const std::uint64_t key =
        ((settings_.seed * 64 + user_) * 2 + static_cast<std::uint64_t>(direction)) * kHashPrime + number;
    return constant_s(direction) + settings_.jitter_s * uniform(key);
  }
  /// Whether it is lost, where it is sent once.
  [[nodiscard]] bool is_lost(Direction direction, std::uint64_t number, std::uint64_t attempt = 0) const noexcept {
    if (settings_.loss_ratio <= 0.0 || is_local(direction)) return false;
    const std::uint64_t stream = (settings_.seed * 64 + user_) * 4 + static_cast<std::uint64_t>(direction);
    return uniform(((stream + kLoss) * 8 + attempt) * kHashPrime + number) < settings_.loss_ratio;
  }
  /// How often it is lost where it is sent again until it arrives.
  [[nodiscard]] std::uint64_t losses(Direction direction, std::uint64_t number) const noexcept {
    std::uint64_t count = 0;
    while (count < kMostLosses && is_lost(direction, number, count)) ++count;
    return count;
  }
  /// What each such loss adds: the receiver asks for it, on top of the way there and back.
  [[nodiscard]] double repeat_s() const noexcept { return settings_.up_s + settings_.down_s + kHeartbeat_s; }
  /// Most that a message takes that is sent once.
  [[nodiscard]] double longest_s(Direction direction) const noexcept {
    return constant_s(direction) + (is_local(direction) ? 0.0 : settings_.jitter_s);
  }

  /// Of one message; then it arrives.
  static constexpr std::uint64_t kMostLosses = 4;

 private:
  static constexpr double kHeartbeat_s = 0.02;
  /// Draws for losses, apart from those for jitter.
  static constexpr std::uint64_t kLoss = 0x5bd1e995;

  /// In [0, 1).
  static double uniform(std::uint64_t key) noexcept { return static_cast<double>(random_bits(key) >> 11U) * 0x1.0p-53; }

  /// A device without a delay is at its sub-world: no network is between them.
  [[nodiscard]] bool is_local(Direction direction) const noexcept {
    return (direction == Direction::from_device || direction == Direction::to_device) &&
           settings_.from_device_s + settings_.to_device_s <= 0.0;
  }
  [[nodiscard]] double constant_s(Direction direction) const noexcept {
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

  DelaySettings settings_;
  std::uint64_t user_;
};

}  // namespace subworld
