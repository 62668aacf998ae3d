#include "model/settings/presence.hpp"

#include "model/joined.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <optional>
#include <sstream>
#include <utility>

namespace subworld {

namespace {

using Kind = PresenceEvent::Kind;

constexpr const char* kEventForms =
    "\"1 joins 3\", \"1 leaves 5\" (user, s), \"0 misses 1 from 4.2 to 4.9\", "
    "\"world engine ode fast from 5\", \"0 engine bullet quality from 5\", \"world ratio 4-8 from 6\" or \"world stops "
    "7\"";

/// Whether a user joins or leaves.
bool changes_presence(const PresenceEvent& event, int user) noexcept {
  return event.user == user && (event.kind == Kind::joins || event.kind == Kind::leaves);
}

bool is_order(const PresenceEvent& event) noexcept {
  return event.kind == Kind::engine || event.kind == Kind::ratio || event.kind == Kind::stops;
}

/// "ode fast from 5" or "4-8 from 6".
bool read_order(std::istringstream& words, PresenceEvent& event) {
  std::string preset, from;
  words >> event.order;
  if (event.kind == Kind::engine && words >> preset) event.order += " " + preset;
  return words >> from >> event.at_s && from == "from" && (event.kind == Kind::engine || event.user == kWorld);
}

std::optional<PresenceEvent> parse_event(const std::string& text) {
  std::istringstream words(text);
  PresenceEvent event;
  std::string subject, verb, from, to;
  if (!(words >> subject >> verb)) return {};
  if (subject == "world") {
    event.user = kWorld;
  } else if (const char* end = subject.data() + subject.size();
             std::from_chars(subject.data(), end, event.user).ptr != end || event.user < 0) {
    return {};
  }
  if (verb == "engine" || verb == "ratio") {
    event.kind = verb == "engine" ? Kind::engine : Kind::ratio;
    if (!read_order(words, event)) return {};
  } else if (event.user == kWorld) {
    event.kind = Kind::stops;
    if (verb != "stops" || !(words >> event.at_s)) return {};
  } else if (verb == "misses") {
    event.kind = Kind::misses;
    if (!(words >> event.peer >> from >> event.at_s) || from != "from") return {};
    if (words >> to && (to != "to" || !(words >> event.to_s))) return {};
  } else {
    if (verb != "joins" && verb != "leaves") return {};
    event.kind = verb == "joins" ? Kind::joins : Kind::leaves;
    if (!(words >> event.at_s)) return {};
  }
  std::string rest;
  if (words >> rest) return {};
  const bool possible = event.peer >= 0 && event.at_s >= 0.0 && event.to_s > event.at_s;
  return possible ? std::optional(event) : std::nullopt;
}

}  // namespace

std::string to_text(const PresenceEvent& event) {
  if (event.kind == Kind::stops) return fmt::format("world stops {:.12g}", event.at_s);
  if (is_order(event))
    return fmt::format("{} {} {} from {:.12g}", event.user == kWorld ? "world" : std::to_string(event.user),
                       event.kind == Kind::engine ? "engine" : "ratio", event.order, event.at_s);
  if (event.kind == Kind::joins) return fmt::format("{} joins {:.12g}", event.user, event.at_s);
  if (event.kind == Kind::leaves) return fmt::format("{} leaves {:.12g}", event.user, event.at_s);
  const std::string to = std::isfinite(event.to_s) ? fmt::format(" to {:.12g}", event.to_s) : "";
  return fmt::format("{} misses {} from {:.12g}{}", event.user, event.peer, event.at_s, to);
}

std::string parse_presence(std::string_view text, std::vector<PresenceEvent>& events) {
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find(',', at), text.size());
    const std::string one(text.substr(at, end - at));
    const auto event = parse_event(one);
    if (!event) return fmt::format("\"{}\" is no event; write {}, with commas between them", one, kEventForms);
    events.push_back(*event);
    at = end + 1;
  }
  return {};
}

std::string to_text(const std::vector<PresenceEvent>& events) {
  std::vector<std::string> texts;
  for (const PresenceEvent& event : events) texts.push_back(to_text(event));
  return joined(texts, ", ");
}

std::string presence_fault(const std::vector<PresenceEvent>& events, int users) {
  for (int user = 0; user < users; ++user) {
    const PresenceEvent* before = nullptr;
    for (const PresenceEvent& event : events) {
      if (!changes_presence(event, user)) continue;
      if (before != nullptr && (before->kind == event.kind || !(event.at_s > before->at_s)))
        return fmt::format("\"{}\" cannot follow \"{}\"; a user joins and leaves in turn, each time later",
                           to_text(event), to_text(*before));
      before = &event;
    }
  }
  for (const PresenceEvent& event : events) {
    const int most = std::max(event.user, event.peer);
    if (most >= users) return fmt::format("\"{}\": there is no user {}; the run has {}", to_text(event), most, users);
  }
  return {};
}

bool takes_part(const std::vector<PresenceEvent>& events, int user, double time_s) noexcept {
  bool first = true, present = true;
  for (const PresenceEvent& event : events) {
    if (!changes_presence(event, user)) continue;
    if (std::exchange(first, false)) present = event.kind == Kind::leaves;
    if (event.at_s <= time_s) present = event.kind == Kind::joins;
  }
  return present;
}

bool misses(const std::vector<PresenceEvent>& events, int user, int peer, double time_s) noexcept {
  return std::ranges::any_of(events, [&](const PresenceEvent& event) {
    return event.kind == Kind::misses && event.user == user && event.peer == peer && event.at_s <= time_s &&
           time_s < event.to_s;
  });
}

std::vector<PresenceEvent> due_orders(const std::vector<PresenceEvent>& events, int user, double from_s, double to_s) {
  std::vector<PresenceEvent> due;
  std::ranges::copy_if(events, std::back_inserter(due), [&](const PresenceEvent& event) {
    return is_order(event) && event.user == user && from_s < event.at_s && event.at_s <= to_s;
  });
  return due;
}

void record(std::vector<PresenceEvent>& events, PresenceEvent::Kind kind, int user, double time_s) {
  const auto joined = std::ranges::find_if(events, [&](const PresenceEvent& event) {
    return event.kind == Kind::joins && event.user == user && event.at_s == time_s;
  });
  if (kind == Kind::leaves && joined != events.end()) {
    events.erase(joined);
  } else {
    events.push_back({.kind = kind, .user = user, .at_s = time_s});
  }
}

void record_missed(std::vector<PresenceEvent>& events, int user, const MissedStates& missed) {
  constexpr double kSame_s = 1e-9;
  const PresenceEvent event{Kind::misses, user, missed.from_s, static_cast<int>(missed.peer), missed.to_s};
  const auto last = std::ranges::find_if(events.rbegin(), events.rend(), [&](const PresenceEvent& one) {
    return one.kind == Kind::misses && one.user == user && one.peer == event.peer;
  });
  if (last != events.rend() && std::abs(last->to_s - event.at_s) < kSame_s) {
    last->to_s = event.to_s;
  } else {
    events.push_back(event);
  }
}

std::string lacking_events(std::string_view record, std::string_view other) {
  std::vector<PresenceEvent> events, had;
  (void)parse_presence(record, events);
  (void)parse_presence(other, had);
  std::erase_if(events, [&](const PresenceEvent& event) {
    return std::ranges::find(had, to_text(event), [](const auto& one) { return to_text(one); }) != had.end();
  });
  return to_text(events);
}

int returns(const std::vector<PresenceEvent>& events, int user) noexcept {
  bool left = false;
  int count = 0;
  for (const PresenceEvent& event : events) {
    if (!changes_presence(event, user)) continue;
    count += left && event.kind == Kind::joins ? 1 : 0;
    left = event.kind == Kind::leaves;
  }
  return count;
}

}  // namespace subworld
