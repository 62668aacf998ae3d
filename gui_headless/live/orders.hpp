#pragma once

#include "wire/bus.hpp"
#include "wire/codec.hpp"

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace subworld::live {

/// Sends viewers' orders to the programs of the run. One thread.
///
/// The topic `control` offers what was sent to late joiners, so a writer that stays would repeat its orders to a world
/// that starts again. The writer therefore ends some time after the latest order.
class Orders {
 public:
  using Clock = std::chrono::steady_clock;

  explicit Orders(Bus& bus) : bus_(bus) {}

  /// Sends a `Control` in CDR. Returns why it did not; empty: sent.
  [[nodiscard]] std::string send(std::span<const std::uint8_t> cdr, Clock::time_point now);
  /// Once in a while.
  void inspect(Clock::time_point now);

 private:
  Bus& bus_;
  Codec<Control> codec_;
  std::optional<Writer<Control>> writer_;
  Clock::time_point until_;
};

}  // namespace subworld::live
