#include "launch.hpp"
#include "model/error.hpp"
#include "rt/cyclic.hpp"
#include "wire/bus.hpp"

#include <fmt/format.h>

#include <array>

namespace subworld {

namespace {

struct Verb {
  std::string_view name;
  ControlVerb verb;
};
constexpr std::array kVerbs{Verb{"stop", ControlVerb::stop}, Verb{"pause", ControlVerb::pause},
                            Verb{"resume", ControlVerb::resume}, Verb{"step", ControlVerb::step}};

}  // namespace

void send_control(const Network& network, const std::string& verb, double wait_s) {
  Control order;
  for (const Verb& known : kVerbs) {
    if (known.name == verb) order.verb = known.verb;
  }
  const auto bus =
      open_bus(network, Settings{}, 0.001, "subworld control");  // lock-step quality: readers of both modes match
  auto writer = bus->writer<Control>();
  const TimePoint until = Clock::now() + from_seconds(wait_s);
  while (writer.matched() == 0) {
    if (Clock::now() > until) {
      throw Error(
          ExitCode::middleware,
          fmt::format("no world on domain {} within {} s; `subworld run` prints its domain, give it with --domain",
                      network.domain, wait_s));
    }
    bus->wait(0.05);
  }
  if (!writer.write(order) || !writer.wait_for_acknowledgments(wait_s)) {
    throw Error(ExitCode::middleware,
                fmt::format("the world on domain {} did not confirm the order; try again", network.domain));
  }
  fmt::print("{}: heard by the world on domain {}\n", verb, network.domain);
}

}  // namespace subworld
