#pragma once

#include "model/messages/message_fields.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <string_view>

/// Orders to the programs, their answers, and what each program says of itself.
namespace subworld {

/// Values as in the IDL. 6 is none: the world refuses it, as all that it does not know.
enum class ControlVerb : std::uint8_t {
  stop,
  pause,
  resume,
  step,
  seek,  ///< of a replay: to a moment
  set_engine,
  leave = 7,
  set_ratio,  ///< "4" or "4-12"
  set_speed,  ///< of a replay: simulated time per time
};

/// The verbs as `subworld control` names them.
struct VerbName {
  ControlVerb verb;
  const char* name;
  const char* example = "";  ///< of its argument on the command line; empty: it has none
};
inline constexpr std::array kVerbs{VerbName{ControlVerb::stop, "stop"},
                                   VerbName{ControlVerb::pause, "pause"},
                                   VerbName{ControlVerb::resume, "resume"},
                                   VerbName{ControlVerb::step, "step"},
                                   VerbName{ControlVerb::leave, "leave", "--user 1"},
                                   VerbName{ControlVerb::set_engine, "engine", "bullet_float"},
                                   VerbName{ControlVerb::set_ratio, "ratio", "--ratio 4-8"},
                                   VerbName{ControlVerb::seek, "seek", "--time 1.5"},
                                   VerbName{ControlVerb::set_speed, "speed", "--speed 2"}};
[[nodiscard]] constexpr std::string_view name_of(ControlVerb verb) noexcept {
  const auto at = std::ranges::find(kVerbs, verb, &VerbName::verb);
  return at != kVerbs.end() ? at->name : "";
}

/// Topic `control`.
struct Control {
  std::uint32_t number = 0;  ///< drawn by the sender; the answer repeats it
  ControlVerb verb = ControlVerb::stop;
  std::string argument;
};
bool fields(auto& archive, Is<Control> auto& m) {
  return archive("number", m.number) && archive("verb", m.verb) && archive.check(m.verb <= ControlVerb::set_speed) &&
         archive("argument", m.argument);
}

/// What came of an order: `preparing` is followed by one of the others.
enum class OrderState : std::uint8_t { preparing, done, refused };
[[nodiscard]] constexpr std::string_view name_of(OrderState state) noexcept {
  constexpr std::array<std::string_view, 3> kNames{"preparing", "done", "refused"};
  const auto at = static_cast<std::size_t>(state);
  return at < kNames.size() ? kNames[at] : "";
}
struct OrderAnswer {
  OrderState outcome = OrderState::done;
  std::string text;
};

struct EventCounts {
  std::uint64_t matched = 0;
  std::uint64_t unmatched = 0;
  std::uint64_t deadline_missed = 0;
  std::uint64_t liveliness_lost = 0;
  std::uint64_t incompatible_qos = 0;
  std::uint64_t lost = 0;      ///< samples that the middleware says are lost
  std::uint64_t rejected = 0;  ///< samples that did not decode or had invalid contents
  std::uint64_t refused = 0;   ///< samples of a foreign writer: one that does not take part in the run
};
bool fields(auto& archive, Is<EventCounts> auto& m) {
  return archive("matched", m.matched) && archive("unmatched", m.unmatched) &&
         archive("deadline_missed", m.deadline_missed) && archive("liveliness_lost", m.liveliness_lost) &&
         archive("incompatible_qos", m.incompatible_qos) && archive("lost", m.lost) &&
         archive("rejected", m.rejected) && archive("refused", m.refused);
}

[[nodiscard]] inline EventCounts operator-(const EventCounts& to, const EventCounts& from) noexcept {
  return {to.matched - from.matched,
          to.unmatched - from.unmatched,
          to.deadline_missed - from.deadline_missed,
          to.liveliness_lost - from.liveliness_lost,
          to.incompatible_qos - from.incompatible_qos,
          to.lost - from.lost,
          to.rejected - from.rejected,
          to.refused - from.refused};
}

enum class ProgramKind : std::uint32_t { world_sim, haptic_sim, device_sim, gui_headless };

/// Topic `control_reply`, keyed by program and instance.
struct ControlReply {
  ProgramKind program = ProgramKind::world_sim;
  std::uint32_t instance = 0;
  std::uint32_t number = 0;  ///< of the `Control`
  OrderAnswer answer;
};
bool fields(auto& archive, Is<ControlReply> auto& m) {
  return archive("program", m.program) && archive.check(m.program <= ProgramKind::gui_headless) &&
         archive("instance", m.instance) && archive("number", m.number) && archive("outcome", m.answer.outcome) &&
         archive.check(m.answer.outcome <= OrderState::refused) && archive("text", m.answer.text);
}

/// State in a `Status` of a program that ends with an error; `text` is the reason.
inline constexpr const char* kFailedState = "failed";
/// State of one that ends in order.
inline constexpr const char* kStoppingState = "stopping";

/// Topic `status`, keyed by program and instance: each program sends one a second.
struct Status {
  ProgramKind program = ProgramKind::world_sim;
  std::uint32_t instance = 0;                 ///< user or device
  std::uint32_t wire_version = kWireVersion;  ///< of another version nothing else is known
  std::string state;                          ///< loading, settling, waiting, running, stopping, failed
  double time_s = 0.0;
  double rate_hz = 0.0;
  std::uint64_t steps = 0;
  std::uint64_t missed_deadlines = 0;
  std::uint64_t missed_by_os = 0;  ///< of `missed_deadlines` (rt/lateness)
  double step_s = 0.0;             ///< mean over the last second
  double force_n = 0.0;            ///< haptic_sim: on the operator
  double real_time_factor = 1.0;   ///< world_sim; 1 elsewhere
  double done_ratio = 0.0;         ///< progress 0 .. 1 of `loading` or `settling`
  bool paused = false;             ///< world_sim: by an order
  std::string waits_for;           ///< program whose messages have not come for 2 s: "haptic_sim 0"; empty: none
  EventCounts events;
  std::string text;  ///< events since the last status, in words
};
bool fields(auto& archive, Is<Status> auto& m) {
  return archive("program", m.program) && archive.check(m.program <= ProgramKind::gui_headless) &&
         archive("instance", m.instance) && archive("wire_version", m.wire_version) && archive("state", m.state) &&
         archive("time_s", m.time_s) && archive("rate_hz", m.rate_hz) && archive("steps", m.steps) &&
         archive("missed_deadlines", m.missed_deadlines) && archive("missed_by_os", m.missed_by_os) &&
         archive("step_s", m.step_s) && archive("force_n", m.force_n) &&
         archive("real_time_factor", m.real_time_factor) && archive("done_ratio", m.done_ratio) &&
         archive("paused", m.paused) && archive("waits_for", m.waits_for) && fields(archive, m.events) &&
         archive("text", m.text);
}

}  // namespace subworld
