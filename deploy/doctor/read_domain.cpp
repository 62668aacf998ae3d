#include "doctor/facts.hpp"
#include "io/options/options.hpp"
#include "model/error.hpp"
#include "wire/bus.hpp"
#include "wire/session.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <future>

namespace subworld::doctor {

namespace {

using ListenClock = std::chrono::steady_clock;
constexpr std::chrono::milliseconds kListen{1300};

/// The newest status of each program.
void keep_newest(std::vector<Status>& statuses, const Status& heard) {
  std::erase_if(statuses,
                [&](const Status& one) { return one.program == heard.program && one.instance == heard.instance; });
  statuses.push_back(heard);
}

/// Joins the domain for a while. Its readers have the quality of real time, which matches programs of both modes.
void listen(const Request& request, int number, Domain& domain) {
  Network network = request.network;
  network.domain = number;
  network.dds = request.dds == "mixed" ? "fastdds" : request.dds;
  Settings listening;
  listening.mode = Mode::realtime;
  try {
    const auto bus = open_bus(network, listening, 0.001, "subworld doctor");
    auto statuses = bus->reader<Status>();
    auto scenes = bus->reader<SceneDescription>();
    const auto until = ListenClock::now() + kListen;
    Status status;
    SceneDescription scene;
    while (ListenClock::now() < until) {
      bus->wait(0.05);
      while (statuses.take(status) == Take::sample) keep_newest(domain.statuses, status);
      while (scenes.take(scene) == Take::sample) {
        domain.users = scene.users;
        domain.scene = scene.name;
      }
      domain.worlds = std::max(domain.worlds, scenes.alive_writers());
    }
  } catch (const Error& wrong) {
    domain.fault = wrong.what();
  }
}

void read_ports(int number, Domain& domain) {
  constexpr int kFirstOfParticipants = 10;
  const int first = first_port(number) + kFirstOfParticipants;
  const int last = first + 2 * participant_room(number) - 1;
  for (const auto& [port, user, inode] : bound_udp_ports()) {
    if (port < first || port > last) continue;
    const auto owner = owner_of_socket(inode);
    constexpr std::array kOurs{"subworld", "world_sim", "haptic_sim", "device_sim", "gui_headless"};
    const bool ours =
        owner && (std::ranges::find(kOurs, owner->second) != kOurs.end() || owner->second.starts_with("lab_"));
    // The sockets of another user's run have no visible owner.
    const bool perhaps_ours =
        !owner && std::ranges::find(domain.programs, number, &RunningProgram::domain) != domain.programs.end();
    if (ours || perhaps_ours) continue;
    domain.foreign_ports.push_back({port, owner ? owner->first : 0, owner ? owner->second : ""});
  }
}

/// The domain that `subworld run` would choose; 0: none is free.
int find_free_domain(const Domain& domain) {
  const auto ports = bound_udp_ports();
  const char* ros = std::getenv("ROS_DOMAIN_ID");
  for (int number = 100; number >= 60; --number) {
    const bool taken = std::ranges::find(domain.programs, number, &RunningProgram::domain) != domain.programs.end() ||
                       (ros != nullptr && std::to_string(number) == ros) || uses_domain(ports, number);
    if (!taken && domain.number != number) return number;
  }
  return 0;
}

void read_domain(const Request& request, const NetworkFacts& network, Domain& domain) {
  domain.number = request.domain;
  domain.free_domain = find_free_domain(domain);
  if (domain.number) read_ports(*domain.number, domain);
  // A name that does not resolve has its own finding, and would block.
  if (std::ranges::any_of(network.peers, [](const Peer& one) { return one.address.empty(); })) return;
  listen(request, domain.number.value_or(domain.free_domain), domain);
}

Needs needs_of(const Request& request) {
  if (request.scene.empty()) return {};
  Options options;
  options.scene = request.scene;
  const Settings settings = load_scene(options).settings;
  return {.users = settings.users,
          .realtime = settings.mode == Mode::realtime,
          .engines = {settings.world.name, settings.haptic.name}};
}

/// The domain, interface and peers that are not given are those of a program on this machine.
void adopt_run(const std::vector<RunningProgram>& programs, Request& request) {
  const auto model = std::ranges::find_if(
      programs, [&](const RunningProgram& one) { return one.domain == request.domain.value_or(one.domain); });
  if (model == programs.end()) return;
  request.domain = model->domain;
  if (!request.network.interface_address.empty() || !request.network.peers.empty()) return;
  request.network.interface_address = model->network.interface_address;
  request.network.peers = model->network.peers;
}

}  // namespace

Facts read_facts(const Request& request) {
  Facts facts{.request = request, .needs = needs_of(request)};
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

}  // namespace subworld::doctor
