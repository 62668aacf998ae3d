#pragma once

#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"
#include "model/settings/journey.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <tuple>
#include <type_traits>

namespace subworld {

enum class Reliability : std::uint8_t { best_effort, reliable };
enum class Durability : std::uint8_t { volatile_, transient_local };
enum class DeadlineKind : std::uint8_t { none, two_device_periods, two_cycles };

/// Quality of service of one topic in real time. For lock-step see `qos_of`.
struct TopicSpec {
  const char* name;
  const char* type;         ///< as the IDL names it
  std::uint32_t key_words;  ///< number of unsigned longs at the start of the type that form its key; at most 4
  Reliability reliability;
  Durability durability;
  int depth;  ///< keep last
  DeadlineKind deadline;
  std::optional<Direction> delayed;  ///< by the artificial delay of this direction
};

/// Depth of topics whose newest sample counts. A reader with a depth of 1 stores the newest sample of all writers, also
/// of a foreign one. With a larger depth the sample of the right writer is among them.
inline constexpr int kNewestOfSeveral = 8;

/// A row of the table: what travels as `M`. An incomplete row does not compile.
template <class M>
struct Topic {
  using Model = M;
  constexpr Topic(const char* name, const char* type, std::uint32_t key_words, Reliability reliability,
                  Durability durability, int depth, DeadlineKind deadline,
                  std::optional<Direction> delayed = {}) noexcept
      : spec{name, type, key_words, reliability, durability, depth, deadline, delayed} {}
  TopicSpec spec;
};

/// All topics. Codecs, readers and writers follow from this table. A new topic needs a struct in the IDL, one in
/// model/exchange with its `fields`, and a row.
inline constexpr std::tuple kTopicTable{
    Topic<SceneDescription>{"scene", "subworld::msg::Scene", 0, Reliability::reliable, Durability::transient_local,
                            kNewestOfSeveral, DeadlineKind::none},
    Topic<DeviceState>{"device_state", "subworld::msg::DeviceState", 1, Reliability::best_effort, Durability::volatile_,
                       kNewestOfSeveral, DeadlineKind::two_device_periods, Direction::from_device},
    Topic<DeviceCommand>{"device_command", "subworld::msg::DeviceCommand", 1, Reliability::best_effort,
                         Durability::volatile_, kNewestOfSeveral, DeadlineKind::two_device_periods,
                         Direction::to_device},
    Topic<WorldFrame>{"world_frame", "subworld::msg::WorldFrame", 1, Reliability::reliable, Durability::volatile_, 8,
                      DeadlineKind::two_cycles, Direction::down},
    Topic<HapticReport>{"haptic_report", "subworld::msg::HapticReport", 1, Reliability::reliable, Durability::volatile_,
                        8, DeadlineKind::two_cycles, Direction::up},
    Topic<WorldSnapshot>{"world_state", "subworld::msg::WorldState", 0, Reliability::best_effort, Durability::volatile_,
                         1, DeadlineKind::none},
    Topic<Control>{"control", "subworld::msg::Control", 0, Reliability::reliable, Durability::transient_local, 16,
                   DeadlineKind::none},
    Topic<ControlReply>{"control_reply", "subworld::msg::ControlReply", 2, Reliability::reliable,
                        Durability::transient_local, 16, DeadlineKind::none},
    Topic<Status>{"status", "subworld::msg::Status", 2, Reliability::reliable, Durability::transient_local, 16,
                  DeadlineKind::none},
};

inline constexpr std::array kTopics =
    std::apply([](const auto&... rows) { return std::array{rows.spec...}; }, kTopicTable);

template <class M, class... Rows>
consteval std::size_t row_of(const std::tuple<Rows...>&) {
  constexpr std::array kHere{std::is_same_v<M, typename Rows::Model>...};
  static_assert(std::ranges::count(kHere, true) == 1, "each model struct has one topic");
  return static_cast<std::size_t>(std::ranges::find(kHere, true) - kHere.begin());
}
template <class M>
inline constexpr std::size_t kTopicIndex = row_of<M>(kTopicTable);
/// The topic of a model struct.
template <class M>
inline constexpr const TopicSpec& kTopicOf = kTopics[kTopicIndex<M>];

/// In real time the other users' programs get the states of a device here, at most every kShared_s: a device's motion
/// is predicted over that time, and each message to each user costs both sides tens of microseconds. A topic of its
/// own: its deadline is too long for a reader of all states, and Fast DDS compares deadlines before partitions.
inline constexpr TopicSpec kSharedDeviceState = [] {
  TopicSpec spec = kTopicOf<DeviceState>;
  spec.name = "shared_device_state";
  spec.delayed = Direction::from_peer;
  return spec;
}();
inline constexpr double kShared_s = 0.004;

inline constexpr double kRepeat_s = 0.02;

/// Each program repeats to each other one what it should know, until it knows it. That grows with the square of their
/// number, and on machines that are short of time all wait for these messages. Therefore they come later by this
/// factor.
constexpr double thinning(int users) noexcept {
  constexpr double kUsual = 8.0;
  return std::max(1.0, users / kUsual);
}

/// Quality of service that a reader or writer requests.
struct Qos {
  bool reliable = false;
  bool transient_local = false;
  bool keep_all = false;        ///< until all readers have received them
  int depth = 1;                ///< unless keep_all
  double deadline_s = 0.0;      ///< 0: none
  double lease_s = 0.1;         ///< of liveliness
  bool writes_live = false;     ///< each sample renews the lease; else the participant does, at each other one
  double repeat_s = kRepeat_s;  ///< a writer says again what a reader should have
  double max_blocking_s = 0.0;
};

/// DDS deadline for samples that should come every `interval_s`: the next whole millisecond, plus 0.9 ms.
///
/// Fast DDS 2.9 arms its timer with the whole milliseconds that remain when a sample arrives. For a deadline of 2 ms
/// these are 1 ms, so a sample a little over 1 ms later would count as missed. With less than 1 ms remaining its thread
/// spins: 0.6 of a core in each program at a deadline of 1 ms. For a deadline of 2.9 ms it uses 2 ms. Both vendors get
/// the same deadline, because otherwise they would not match.
constexpr double deadline_s(double interval_s) noexcept {
  constexpr double kMillisecond = 1e-3, kRoundingError = 1e-6;
  const auto begun = static_cast<long>(interval_s / kMillisecond - kRoundingError);
  return (static_cast<double>(begun) + 1.9) * kMillisecond;
}

inline constexpr double kLongLease_s = 3.0;

/// In lock-step a lost sample would stop the run. Therefore every topic is reliable, keep-all and without deadline. It
/// is transient local too, because a volatile reader may miss samples written in the milliseconds after both sides have
/// matched. In real time a writer drops samples that the network delays, instead of blocking the loop.
constexpr Qos qos_of(const TopicSpec& topic, Mode mode, double device_period_s, double cycle_s) noexcept {
  Qos qos;
  qos.transient_local = topic.durability == Durability::transient_local;
  // Lock-step has no use for a short lease. What late joiners read must match in both modes.
  qos.writes_live = mode == Mode::realtime && topic.deadline != DeadlineKind::none;
  if (!qos.writes_live) qos.lease_s = kLongLease_s;
  if (qos.transient_local) qos.repeat_s = 10.0 * kRepeat_s;  // nothing waits for these
  if (mode == Mode::lockstep) {
    qos.reliable = true;
    qos.keep_all = true;
    qos.transient_local = true;
    qos.max_blocking_s = 10.0;
    return qos;
  }
  qos.reliable = topic.reliability == Reliability::reliable;
  qos.depth = topic.depth;
  if (topic.deadline == DeadlineKind::two_device_periods) qos.deadline_s = deadline_s(2.0 * device_period_s);
  if (topic.deadline == DeadlineKind::two_cycles) qos.deadline_s = deadline_s(2.0 * cycle_s);
  return qos;
}

}  // namespace subworld
