#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

namespace subworld {

/// `PresenceEvent::user` of an order that the world follows.
inline constexpr int kWorld = -1;

/// When users take part in a run and what is ordered, in simulated time: planned by a scene, or recorded from a run in
/// lock-step, which repeats bit by bit with its record.
struct PresenceEvent {
  enum class Kind : std::uint8_t {
    joins,
    leaves,
    misses,  ///< the sub-world of `user` does not have the states of the device of `peer` from `at_s` to `to_s`
    engine,  ///< the world, or the sub-world of `user`, changes its engine
    ratio,   ///< the world narrows the bounds of its ratio
    stops,   ///< the world's cycle that begins at `at_s` is the last
  };
  Kind kind = Kind::joins;
  int user = 0;
  double at_s = 0.0;
  int peer = 0;
  double to_s = std::numeric_limits<double>::infinity();
  std::string order = {};  ///< `engine`: engine and preset as in "ode fast"; `ratio`: as in "4-8"
};

/// An interval of simulated time, in lock-step.
struct MissedStates {
  std::uint32_t peer = 0;  ///< the user whose device's states the sub-world needed and did not have
  double from_s = 0.0;
  double to_s = 0.0;
};

/// A change of engine that a sub-world has begun with, in lock-step.
struct FollowedOrder {
  double at_s = 0.0;
  std::string engine;  ///< and preset, as in "ode fast"
};

/// As in "1 joins 3, 2 leaves 5, 0 misses 1 from 4.2 to 4.9, world engine ode fast from 5, 0 engine bullet quality from
/// 5, world ratio 4-8 from 6, world stops 7". Appends to `events`; returns what is wrong, with the cure, or nothing.
[[nodiscard]] std::string parse_presence(std::string_view text, std::vector<PresenceEvent>& events);
[[nodiscard]] std::string to_text(const PresenceEvent& event);
[[nodiscard]] std::string to_text(const std::vector<PresenceEvent>& events);
/// What is wrong with the events of a scene with so many users, with the cure; empty: nothing.
[[nodiscard]] std::string presence_fault(const std::vector<PresenceEvent>& events, int users);

/// Whether a user takes part at a time. One that joins first is absent before.
[[nodiscard]] bool takes_part(const std::vector<PresenceEvent>& events, int user, double time_s) noexcept;
/// Whether the sub-world of a user misses the states of another one's device at a time.
[[nodiscard]] bool misses(const std::vector<PresenceEvent>& events, int user, int peer, double time_s) noexcept;
/// The orders for the world or for the sub-world of a user that are due after `from_s`, until `to_s`.
[[nodiscard]] std::vector<PresenceEvent> due_orders(const std::vector<PresenceEvent>& events, int user, double from_s,
                                                    double to_s);
/// Adds to a record that a user joins or leaves. One who leaves when it has only just joined was not there.
void record(std::vector<PresenceEvent>& events, PresenceEvent::Kind kind, int user, double time_s);
/// Adds to a record that the sub-world of a user missed the states of another one's device. Intervals that follow each
/// other are one.
void record_missed(std::vector<PresenceEvent>& events, int user, const MissedStates& missed);
/// The events of a record that another record lacks; both as text.
[[nodiscard]] std::string lacking_events(std::string_view record, std::string_view other);
/// How often a user joins after having left.
[[nodiscard]] int returns(const std::vector<PresenceEvent>& events, int user) noexcept;

}  // namespace subworld
