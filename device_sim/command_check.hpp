#pragma once

#include "model/messages/exchange.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace subworld {

/// Whether the haptic process can have sent a command: it answers a state that this device has sent, and none that is
/// older than the last one. The middleware identifies a writer by what its packets say, and packets can be forged.
class CommandCheck {
 public:
  /// A state of this device, in the order of sending.
  void sent(std::uint64_t sequence, std::int64_t sent_ns) noexcept {
    sent_[count_++ % kKept] = {sequence, sent_ns};
    newest_ = sequence;
  }

  [[nodiscard]] bool possible(const DeviceCommand& command) noexcept {
    if (command.last) return true;  // any moment may be the end
    if (command.sequence < answered_ || command.sequence > newest_) return false;
    if (command.echoed_sent_ns != 0 && !echoes(command)) return false;  // 0: of an extrapolated state
    answered_ = command.sequence;
    return true;
  }

 private:
  [[nodiscard]] bool echoes(const DeviceCommand& command) const noexcept {
    if (count_ > kKept && command.sequence < sent_[count_ % kKept].sequence) return true;  // after a halt: forgotten
    const auto end = sent_.begin() + static_cast<std::ptrdiff_t>(std::min(count_, kKept));
    return std::any_of(sent_.begin(), end, [&](const State& one) {
      return one.sequence == command.sequence && one.sent_ns == command.echoed_sent_ns;
    });
  }

  struct State {
    std::uint64_t sequence = 0;
    std::int64_t sent_ns = 0;
  };
  static constexpr std::size_t kKept = 1024;  ///< a second at 1 kHz: more than a network delays an answer
  std::array<State, kKept> sent_{};
  std::size_t count_ = 0;
  std::uint64_t newest_ = 0, answered_ = 0;  ///< sequences of the states that were sent, and answered, last
};

}  // namespace subworld
