#include "commands.hpp"

#include "model/error.hpp"
#include "model/joined.hpp"
#include "physics/shells/engine_exchange.hpp"
#include "rt/cyclic.hpp"
#include "wire/bus.hpp"
#include "wire/session.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <map>
#include <random>
#include <string>
#include <vector>

namespace subworld {

namespace {

/// Waits until the world has described itself. Throws `Error` (middleware) where none does.
SceneDescription find_world(Bus& bus, Reader<SceneDescription>& scene, const Network& network, double wait_s) {
  SceneDescription description;
  const TimePoint until = Clock::now() + from_seconds(wait_s);
  while (scene.take(description) != Take::sample) {
    if (Clock::now() > until) {
      throw Error(
          ExitCode::middleware,
          fmt::format(
              "no world on domain {} within {} s; `subworld run` prints its domain, give it with --domain; on "
              "another host, name it with --peers and give --interface{}",
              network.domain, wait_s,
              network.secure.empty() ? "; where it has keys, give --secure" : "; give its own keys and its --dds"));
    }
    bus.wait(0.05);
  }
  return description;
}

/// The answers of those that an order is for: the world, or every sub-world.
class Answers {
 public:
  Answers(const Control& order, ProgramKind asked, std::uint32_t expected)
      : order_(order.number), asked_(asked), expected_(expected) {}

  /// Prints the answer. Throws `Error` (failed) where one that the order is for refuses.
  void hear(const ControlReply& reply) {
    if (reply.number != order_) return;
    const bool asked = reply.program == asked_;
    const std::string label = label_of(reply.program, reply.instance);
    if (asked && reply.answer.outcome == OrderState::refused)
      throw Error(ExitCode::failed, fmt::format("{}: refused: {}", label, reply.answer.text));
    fmt::print("{}: {}\n", label, reply.answer.text);
    if (asked) said_[reply.instance] = reply.answer;
  }
  /// Whether all have executed it.
  [[nodiscard]] bool complete() const {
    return std::ranges::count_if(said_, [](const auto& one) { return done(one.second); }) >= expected_;
  }

  [[nodiscard]] bool of_sub_worlds() const { return asked_ == ProgramKind::haptic_sim; }

  /// Those that have not, in words.
  [[nodiscard]] std::string missing() const {
    std::vector<std::string> names;
    for (std::uint32_t instance = 0; instance < expected_; ++instance) {
      const auto said = said_.find(instance);
      if (said == said_.end()) {
        names.push_back(label_of(asked_, instance));
      } else if (!done(said->second)) {
        names.push_back(fmt::format("{} (so far: \"{}\")", label_of(asked_, instance), said->second.text));
      }
    }
    return joined(names, " and ");
  }

 private:
  [[nodiscard]] static bool done(const OrderAnswer& said) { return said.outcome != OrderState::preparing; }
  std::uint32_t order_;
  ProgramKind asked_;
  std::uint32_t expected_;
  std::map<std::uint32_t, OrderAnswer> said_;  ///< the newest answer, by instance
};

/// Prints the answers to the order, until each program that it is for has executed it. Throws `Error` (failed) where
/// one refuses, or does not execute it within `wait_s`.
void await_answers(Bus& bus, Reader<ControlReply>& replies, const Reader<SceneDescription>& scene, const Control& order,
                   Answers& answers, double wait_s) {
  const TimePoint until = Clock::now() + from_seconds(wait_s);
  ControlReply reply;
  while (true) {
    while (replies.take(reply) == Take::sample) answers.hear(reply);
    if (answers.complete()) return;
    if (order.verb == ControlVerb::stop && scene.matched() == 0) return;  // it has ended
    if (Clock::now() > until) break;
    bus.wait(0.05);
  }
  throw Error(
      ExitCode::failed,
      fmt::format("no final answer from {} within {} s; wait longer with --wait{}. The order stays in force: see the "
                  "run's summary",
                  answers.missing(), wait_s,
                  answers.of_sub_worlds() ? ", or, where a world in lock-step is paused, continue it with `subworld "
                                            "control resume`: its sub-worlds read orders as they step"
                                          : ""));
}

}  // namespace

void send_control(const Network& network, Control order, double wait_s) {
  order.number = std::random_device()();
  // A reader of real-time quality matches programs in both modes.
  Settings listening;
  listening.mode = Mode::realtime;
  const auto bus = open_bus(network, listening, 0.001, "subworld control");
  auto replies = bus->reader<ControlReply>();
  auto scene = bus->reader<SceneDescription>();
  auto writer = bus->writer_to_all<Control>();
  const SceneDescription world = find_world(*bus, scene, network, wait_s);
  if (!writer.write(order)) {
    throw Error(ExitCode::middleware,
                fmt::format("the order could not be sent on domain {}; try again", network.domain));
  }
  fmt::print("{}: sent to \"{}\" on domain {}\n", name_of(order.verb), world.name, network.domain);
  const bool for_sub_worlds = order_for_sub_worlds(order).has_value();
  Answers answers(order, for_sub_worlds ? ProgramKind::haptic_sim : ProgramKind::world_sim,
                  for_sub_worlds ? world.users : 1);
  await_answers(*bus, replies, scene, order, answers, wait_s);
}

}  // namespace subworld
