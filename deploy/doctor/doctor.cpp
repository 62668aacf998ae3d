#include "doctor/doctor.hpp"

#include "doctor/checks.hpp"
#include "io/json.hpp"
#include "io/options.hpp"
#include "model/error.hpp"
#include "wire/session.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <future>

namespace subworld::doctor {

namespace {

Needs needs_of(const Request& request) {
  Needs needs;
  if (request.scene.empty()) return needs;
  Options options;
  options.scene = request.scene;
  const Scene scene = load_scene(options);
  needs.users = scene.settings.users;
  needs.realtime = scene.settings.mode == Mode::realtime;
  needs.engines = {scene.settings.world.name};
  if (scene.settings.haptic.name != scene.settings.world.name) needs.engines.push_back(scene.settings.haptic.name);
  return needs;
}

/// Without --domain the run on this machine is examined, through the interface of its programs.
void adopt_run(const std::vector<RunningProgram>& programs, Request& request) {
  if (request.domain || programs.empty()) return;
  const RunningProgram& model = programs.front();
  request.domain = model.domain;
  if (!request.network.interface_address.empty() || !request.network.peers.empty()) return;
  request.network.interface_address = model.network.interface_address;
  request.network.peers = model.network.peers;
}

/// Facts that are neither right nor wrong.
std::vector<std::string> remarks(const Facts& facts) {
  std::vector<std::string> lines;
  const Machine& machine = facts.machine;
  lines.push_back(
      fmt::format("bare loops wake p99 {:.3f} ms late, at most {:.3f} ms, {} of {} times later than {:g} ms",
                  1e3 * machine.lateness_p99_s, 1e3 * machine.lateness_max_s, machine.late_wake_ups, machine.wake_ups,
                  1e3 * machine.period_s));
  for (const InstalledPart& part : machine.parts) lines.push_back(fmt::format("{}: {}", part.name, part.version));
  for (const Interface& one : facts.network.interfaces) {
    lines.push_back(fmt::format("interface {}: {}, {}, MTU {}; multicast {} (Subworld does not use it)", one.name,
                                one.address.empty() ? "no IPv4 address" : one.address,
                                one.running ? "running" : "not running", one.mtu, one.multicast ? "possible" : "off"));
  }
  for (const Peer& peer : facts.network.peers) {
    if (!peer.clock_offset_s) continue;
    lines.push_back(fmt::format("clock of {}: {:+.3f} s against this one, within {:.3f} s", peer.host,
                                *peer.clock_offset_s, peer.clock_uncertainty_s));
  }
  if (!facts.domain.number)
    lines.emplace_back(
        "no run is on this machine, and no --domain is given: the checks of a domain have nothing to do");
  for (const Status& one : facts.domain.statuses)
    lines.push_back(fmt::format("domain {}: {} is {}", facts.domain.number.value_or(0),
                                label_of(one.program, one.instance), one.state));
  return lines;
}

void print_text(const Facts& facts, const std::vector<Finding>& findings) {
  if (facts.request.verbose) {
    for (const std::string& line : remarks(facts)) fmt::print("{}\n", line);
    for (const Check& check : checks()) {
      const bool found = std::ranges::find(findings, check.name, &Finding::check) != findings.end();
      fmt::print("{} {}: {}\n", found ? "FOUND" : "ok   ", check.name, check.about);
    }
  }
  for (const Finding& one : findings) {
    const Finding& first = *std::ranges::find(findings, one.cure, &Finding::cure);
    fmt::print("{}: {}\n  why:  {}\n  cure: {}\n", one.check, one.what, one.why,
               &first == &one ? one.cure : fmt::format("the same command as for {}, once", first.check));
  }
  const std::size_t total = checks().size();
  if (findings.empty()) {
    fmt::print("healthy: {} checks passed\n", total);
    return;
  }
  const auto failed = static_cast<std::size_t>(std::ranges::count_if(checks(), [&](const Check& one) {
    return std::ranges::find(findings, one.name, &Finding::check) != findings.end();
  }));
  fmt::print("{} finding{}; {} of {} checks passed\n", findings.size(), findings.size() == 1 ? "" : "s", total - failed,
             total);
}

void print_json(const Facts& facts, const std::vector<Finding>& findings) {
  Json json{{"healthy", findings.empty()}, {"checks", Json::array()}, {"findings", Json::array()}};
  for (const Check& check : checks()) json["checks"].push_back(check.name);
  for (const Finding& one : findings)
    json["findings"].push_back({{"check", one.check}, {"what", one.what}, {"why", one.why}, {"cure", one.cure}});
  json["remarks"] = remarks(facts);
  fmt::print("{}\n", json_text(json, 2));
}

}  // namespace

Facts read_facts(const Request& request) {
  Facts facts{.request = request};
  facts.needs = needs_of(request);
  facts.domain.programs = running_programs();
  adopt_run(facts.domain.programs, facts.request);
  // The calibration locks memory: the threads of the middleware start after it.
  read_machine(facts.request, facts.needs, facts.machine);
  read_network(facts.request, facts.network);
  constexpr int kFirstChosen = 100;
  NetworkFacts probed = facts.network;
  auto probes = std::async(std::launch::async,
                           [&] { probe_peers(facts.request, facts.request.domain.value_or(kFirstChosen), probed); });
  read_domain(facts.request, facts.network, facts.domain);
  probes.get();
  facts.network = std::move(probed);
  return facts;
}

int run(const Request& request) {
  const Facts facts = read_facts(request);
  const std::vector<Finding> findings = judge(facts);
  if (request.json) {
    print_json(facts, findings);
  } else {
    print_text(facts, findings);
  }
  std::fflush(stdout);
  return static_cast<int>(findings.empty() ? ExitCode::done : ExitCode::quality);
}

}  // namespace subworld::doctor
