#pragma once

#include "wire/bus.hpp"
#include "wire/codec/codec.hpp"

#include <chrono>
#include <cstdint>
#include <exception>
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
  [[nodiscard]] std::string send(std::span<const std::uint8_t> cdr, Clock::time_point now) {
    Control order;
    if (!codec_.decode(cdr, order)) return "the order is no subworld::msg::Control";
    try {
      if (!writer_) writer_.emplace(bus_.writer<Control>());
    } catch (const std::exception& fault) {
      return fault.what();
    }
    until_ = now + std::chrono::seconds(5);  // discovery takes less than a second
    return writer_->write(order) ? std::string{} : "the middleware did not take the order; try again";
  }
  /// Once in a while.
  void inspect(Clock::time_point now) {
    if (now > until_) writer_.reset();
  }

 private:
  Bus& bus_;
  Codec<Control> codec_;
  std::optional<Writer<Control>> writer_;
  Clock::time_point until_;
};

}  // namespace subworld::live
