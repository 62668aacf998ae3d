#include "doctor/checks.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <string_view>

namespace subworld::doctor {

namespace {

using Findings = std::vector<Finding>;

std::string with_free_domain(const Facts& facts) {
  Request request = facts.request;
  request.domain = facts.domain.free_domains.empty() ? 0 : facts.domain.free_domains.front();
  return command_of(request);
}

/// Findings that say why no participant could be made.
bool explains_fault(const Finding& finding) {
  constexpr std::array<std::string_view, 8> kCauses{"vendor_plugin",     "loopback",     "peers_need_interface",
                                                    "interface_exists",  "interface_up", "carrier",
                                                    "interface_address", "qos_file"};
  return std::ranges::find(kCauses, finding.check) != kCauses.end();
}

void judge_joining(const Facts& facts, Findings& out) {
  if (facts.domain.opened || std::ranges::any_of(out, explains_fault)) return;
  const auto& environment = facts.machine.environment;
  constexpr std::array<std::string_view, 2> kSettings{"CYCLONEDDS_URI", "FASTRTPS_DEFAULT_PROFILES_FILE"};
  const auto settings = std::ranges::find_if(environment, [&](const auto& one) {
    return std::ranges::find(kSettings, one.first) != kSettings.end() &&
           facts.domain.fault.find(one.second) != std::string::npos;
  });
  out.push_back(
      {.what = facts.domain.fault,
       .why = "no program can take part in a run here",
       .cure = settings != environment.end() ? fmt::format("unset {}", settings->first) : with_free_domain(facts)});
}

/// Of the domain in question, else of the first one that a run takes.
void judge_ephemeral_ports(const Facts& facts, Findings& out) {
  constexpr int kFirstChosen = 100, kUsualFirst = 32'768;
  const int domain = facts.domain.number.value_or(kFirstChosen);
  const auto [first, last] = facts.machine.ephemeral_ports;
  const int end = first_port(domain) + kPortsOfDomain;
  if (end <= first || first_port(domain) > last) return;
  out.push_back(
      {.what = fmt::format("the UDP ports {} to {} of domain {} are among those that Linux gives to any program "
                           "({} to {})",
                           first_port(domain), end - 1, domain, first, last),
       .why = "now and then another socket has one of them, and a program does not find its peers",
       .cure = first < kUsualFirst
                   ? fmt::format("{}sysctl -w net.ipv4.ip_local_port_range='32768 60999'", as_root(facts))
                   : with_free_domain(facts)});
}

void judge_user_room(const Facts& facts, Findings& out) {
  const int domain = facts.domain.number.value_or(0);
  const int users = facts.needs.users, room = user_room(domain), most = user_room(0);
  if (users <= room) return;
  out.push_back(
      {.what = fmt::format("domain {} has room for {} users on one host; the scene has {}", domain, room, users),
       .why = "a run is refused: each program needs two UDP ports of the domain",
       .cure = users <= most ? with_free_domain(facts)
                             : fmt::format("subworld run {} --users {}", facts.request.scene, most)});
}

void judge_foreign_ports(const Facts& facts, Findings& out) {
  const auto& ports = facts.domain.foreign_ports;
  if (ports.empty()) return;
  const ForeignPort& first = ports.front();
  const std::string owner =
      first.pid == 0 ? "a program of another user" : fmt::format("{} (process {})", first.name, first.pid);
  out.push_back(
      {.what = fmt::format("{} has UDP port {} of domain {}{}", owner, first.port, *facts.domain.number,
                           ports.size() == 1 ? "" : fmt::format(", and {} more are in use", ports.size() - 1)),
       .why = "each takes the place of a program of the run; it may be a DDS program of another system",
       .cure = with_free_domain(facts)});
}

void judge_ros_domain(const Facts& facts, Findings& out) {
  const auto& environment = facts.machine.environment;
  const auto ros = std::ranges::find(environment, "ROS_DOMAIN_ID", &std::pair<std::string, std::string>::first);
  if (ros == environment.end() || !facts.domain.number || ros->second != std::to_string(*facts.domain.number)) return;
  out.push_back(
      {.what = fmt::format("ROS uses domain {} too (ROS_DOMAIN_ID)", ros->second),
       .why = "programs of both systems search for each other all the time, and share the ports of the domain",
       .cure = with_free_domain(facts)});
}

constexpr std::array kDomainChecks{
    Check{"joining", "a participant of the vendor can join the domain", judge_joining},
    Check{"ephemeral_ports", "the domain's ports are not among those that Linux gives to any socket",
          judge_ephemeral_ports},
    Check{"user_room", "the domain has ports for the users of the scene", judge_user_room},
    Check{"foreign_ports", "no other program has a port of the domain", judge_foreign_ports},
    Check{"ros_domain", "ROS uses another domain (`ROS_DOMAIN_ID`)", judge_ros_domain}};

}  // namespace

std::span<const Check> domain_checks() { return kDomainChecks; }

}  // namespace subworld::doctor
