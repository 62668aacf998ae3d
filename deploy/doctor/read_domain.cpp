#include "doctor/facts.hpp"
#include "io/version.hpp"
#include "model/error.hpp"
#include "tools.hpp"
#include "wire/bus.hpp"

#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <thread>

namespace subworld::doctor {

namespace {

using ListenClock = std::chrono::steady_clock;
constexpr std::chrono::milliseconds kListen{1300};

/// The newest status of each program.
void keep_newest(std::vector<Status>& statuses, const Status& heard) {
  const auto same = std::ranges::find_if(
      statuses, [&](const Status& one) { return one.program == heard.program && one.instance == heard.instance; });
  if (same == statuses.end()) {
    statuses.push_back(heard);
  } else {
    *same = heard;
  }
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
    domain.opened = false;
    domain.fault = wrong.what();
  }
}

/// Whether a program may be called: another user's could do anything with this user's rights.
bool is_trusted(const std::string& file) {
  struct stat owner {};
  return file.find('\'') == std::string::npos && stat(file.c_str(), &owner) == 0 &&
         (owner.st_uid == geteuid() || owner.st_uid == 0);
}

/// Versions of the programs that were started from another folder than this one.
void read_versions(Domain& domain) {
  for (const RunningProgram& one : domain.programs) {
    if (one.file.empty() || one.file_replaced) continue;
    if (std::filesystem::path(one.file).parent_path() == program_folder() || !is_trusted(one.file)) continue;
    const std::unique_ptr<std::FILE, decltype([](std::FILE* pipe) { pclose(pipe); })> pipe(
        popen(fmt::format("'{}' --version 2>&1", one.file).c_str(), "re"));
    std::array<char, 256> line{};
    if (!pipe || std::fgets(line.data(), line.size(), pipe.get()) == nullptr) continue;
    std::string version = line.data();
    while (version.ends_with('\n')) version.pop_back();
    domain.versions.emplace_back(one.pid, version);
  }
}

void read_ports(int number, Domain& domain) {
  constexpr int kFirstOfParticipants = 10;
  const int first = first_port(number) + kFirstOfParticipants;
  const int last = first + 2 * participant_room(number) - 1;
  for (const auto& [port, inode] : bound_udp_ports()) {
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

/// Domains for another run: those that `subworld run` would choose.
std::vector<int> find_free_domains(const Domain& domain) {
  const std::vector<ClaimedDomain> claimed = claimed_domains();
  const auto ports = bound_udp_ports();
  const char* ros = std::getenv("ROS_DOMAIN_ID");
  std::vector<int> free;
  for (int number = 100; number >= 60 && free.size() < 3; --number) {
    const bool taken = std::ranges::find(claimed, number, &ClaimedDomain::domain) != claimed.end() ||
                       std::ranges::find(domain.programs, number, &RunningProgram::domain) != domain.programs.end() ||
                       (ros != nullptr && std::to_string(number) == ros) ||
                       std::ranges::any_of(ports, [&](const auto& one) {
                         return one.first >= first_port(number) && one.first < first_port(number) + kPortsOfDomain;
                       });
    if (!taken && domain.number != number) free.push_back(number);
  }
  return free;
}

}  // namespace

void read_domain(const Request& request, const NetworkFacts& network, Domain& domain) {
  domain.number = request.domain;
  domain.free_domains = find_free_domains(domain);
  read_versions(domain);
  if (domain.number) read_ports(*domain.number, domain);
  // A name that does not resolve has its own finding, and would block.
  if (std::ranges::any_of(network.peers, [](const Peer& one) { return one.address.empty(); })) return;
  const int number = domain.number ? *domain.number : domain.free_domains.empty() ? 0 : domain.free_domains.front();
  listen(request, number, domain);
}

}  // namespace subworld::doctor
