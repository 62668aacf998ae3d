#include "launch.hpp"
#include "model/error.hpp"
#include "physics/engine_exchange.hpp"
#include "rt/cyclic.hpp"
#include "wire/bus.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <vector>

namespace subworld {

namespace {

struct Verb {
  std::string_view name;
  ControlVerb verb;
};
constexpr std::array kVerbs{Verb{"stop", ControlVerb::stop}, Verb{"pause", ControlVerb::pause},
                            Verb{"resume", ControlVerb::resume}, Verb{"step", ControlVerb::step},
                            Verb{"engine", ControlVerb::set_engine}};
constexpr std::string_view kAnswer = "control: ";
constexpr std::string_view kRefused = "refused: ";

constexpr double kQuiet_s = 0.5;  ///< after which nobody more is expected

/// Waits until as many programs as there are listen. Throws `Error` (middleware) where none does.
void wait_for_listeners(Bus& bus, const Writer<Control>& writer, const Network& network, double wait_s) {
  const TimePoint until = Clock::now() + from_seconds(wait_s);
  TimePoint settled = Clock::now() + from_seconds(kQuiet_s);
  for (int matched = 0; matched == 0 || Clock::now() < settled;) {
    if (Clock::now() > until) {
      throw Error(
          ExitCode::middleware,
          fmt::format("no world on domain {} within {} s; `subworld run` prints its domain, give it with --domain",
                      network.domain, wait_s));
    }
    if (writer.matched() != matched) settled = Clock::now() + from_seconds(kQuiet_s);
    matched = writer.matched();
    bus.wait(0.05);
  }
}

/// What a status answers: "control: " and a text each, joined by "; " where several answers came between two statuses.
std::vector<std::string> answers_in(const std::string& status) {
  std::vector<std::string> answers;
  const std::string separator = "; " + std::string(kAnswer);
  for (std::size_t at = status.find(kAnswer); at != std::string::npos;) {
    at += kAnswer.size();
    const std::size_t end = status.find(separator, at);
    answers.push_back(status.substr(at, end - at));
    at = end == std::string::npos ? end : end + separator.size() - kAnswer.size();
  }
  return answers;
}

/// Prints what the programs say to the order, until it is done or `wait_s` have passed. Throws `Error` (failed) where
/// one refuses.
void print_answers(Bus& bus, Reader<Status>& statuses, double wait_s) {
  TimePoint until = Clock::now() + from_seconds(wait_s);
  Status status;
  while (Clock::now() < until) {
    while (statuses.take(status) == Take::sample) {
      const std::string who = status.program == ProgramKind::world_sim ? std::string("world_sim")
                                                                       : fmt::format("haptic_sim {}", status.instance);
      for (const std::string& answer : answers_in(status.text)) {
        if (answer.find(kRefused) != std::string::npos) {
          throw Error(ExitCode::failed, fmt::format("{}: {}", who, answer));
        }
        fmt::print("{}: {}\n", who, answer);
        if (!answer.starts_with("preparing")) until = std::min(until, Clock::now() + from_seconds(kQuiet_s));
      }
    }
    bus.wait(0.05);
  }
}

}  // namespace

void send_control(const Network& network, const std::string& verb, const EngineOrder& engine, double wait_s) {
  Control order;
  if (verb == "engine") order.argument = to_text(engine);
  for (const Verb& known : kVerbs) {
    if (known.name == verb) order.verb = known.verb;
  }
  // What offers lock-step's quality and asks for real time's matches programs in both modes.
  Settings listening;
  listening.mode = Mode::realtime;
  const auto hearing = open_bus(network, listening, 0.001, "subworld control");
  auto statuses = hearing->reader<Status>();
  const auto bus = open_bus(network, Settings{}, 0.001, "subworld control");
  auto writer = bus->writer<Control>();
  wait_for_listeners(*bus, writer, network, wait_s);
  if (!writer.write(order) || !writer.wait_for_acknowledgments(wait_s)) {
    throw Error(ExitCode::middleware,
                fmt::format("the world on domain {} did not confirm the order; try again", network.domain));
  }
  fmt::print("{}: heard on domain {}\n", verb, network.domain);
  print_answers(*hearing, statuses, wait_s);
}

}  // namespace subworld
