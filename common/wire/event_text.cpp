#include "wire/event_text.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>

namespace subworld::wire {

namespace {

/// A periodic topic: its sender, and how its reader continues without a sample.
struct Stream {
  std::string_view topic;
  std::string_view sender;
  std::string_view without;
};
constexpr std::array kStreams{
    Stream{kTopicOf<WorldFrame>.name, "world_sim", "the sub-world continued from the last one"},
    Stream{kTopicOf<HapticReport>.name, "haptic_sim", "the world continued from the last one"},
    Stream{kTopicOf<DeviceState>.name, "device_sim", "the force was computed from the last one"},
    Stream{kTopicOf<DeviceCommand>.name, "haptic_sim", "the device held the last force"},
};

}  // namespace

EventKind kind_of(Event event) noexcept {
  const bool absence = event == Event::deadline_missed || event == Event::liveliness_lost || event == Event::lost;
  return absence ? EventKind::absence : EventKind::fault;
}

std::string explain(Event event, std::string_view side, std::string_view topic, std::string_view detail) {
  const auto* const stream = std::ranges::find(kStreams, topic, &Stream::topic);
  const auto [_, sender, without] =
      stream != kStreams.end() ? *stream : Stream{topic, "its sender", "its reader continued without it"};
  switch (event) {
    case Event::deadline_missed:
      if (side == "writer") return {};  // the loop itself counts its missed deadlines
      return fmt::format("no {} for two periods: {} or the network was late, and {}; from now on only counted", topic,
                         sender, without);
    case Event::lost:
      return fmt::format(
          "the network lost a {}, and {}; from now on only counted. If there are many: a larger receive "
          "buffer (sysctl net.core.rmem_max) or a quieter network",
          topic, without);
    case Event::liveliness_lost:
      return fmt::format("no sign of life of {} for 100 ms ({}): it ended, was suspended, or the network is down",
                         sender, topic);
    case Event::incompatible_qos:
      return fmt::format(
          "{} of {} matches a peer with incompatible settings ({}): another --ratio, h_s, --mode or version; give "
          "every program of the run the same scene and flags, and other runs another --domain",
          side, topic, detail);
    case Event::rejected:
      return fmt::format(
          "a {} was dropped ({}): another version of Subworld or another program sends on this domain; "
          "choose another --domain",
          topic, detail);
    case Event::refused:
      if (topic == kParticipant)
        return "a program that did not prove its role is not heard: start it with --secure and the keys of this run, "
               "or "
               "end it";
      return fmt::format(
          "a {0} of a second {1} was refused: this run continues with its first {1}; end the other {1}, or "
          "give it another --domain",
          topic, sender);
    case Event::matched:
    case Event::unmatched:
      break;
  }
  return {};
}

}  // namespace subworld::wire
