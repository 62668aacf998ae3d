#include "doctor/checks.hpp"

#include "model/joined.hpp"

#include <fmt/core.h>

#include <algorithm>

namespace subworld::doctor {

std::span<const Check> checks() {
  static const std::vector<Check> kAll = [] {
    std::vector<Check> all;
    for (const auto part :
         {machine_checks(), installation_checks(), network_checks(), peer_checks(), domain_checks(), program_checks()})
      all.insert(all.end(), part.begin(), part.end());
    return all;
  }();
  return kAll;
}

namespace {

/// The command that raises limits, without them.
std::string command_for_limits(const Facts& facts) {
  if (facts.machine.may_raise_limits) return fmt::format("{}prlimit --pid $$", as_root(facts));
  return "exit  # and start the container with --cap-add SYS_NICE --cap-add IPC_LOCK";
}

/// One command raises all limits: a container is started once. All findings on limits have that cure.
void merge_cures_of_limits(const Facts& facts, std::vector<Finding>& findings) {
  const std::string command = command_for_limits(facts);
  std::string limits;
  for (const Finding& one : findings) {
    if (one.cure.starts_with(command)) limits += one.cure.substr(command.size());
  }
  for (Finding& one : findings) {
    if (one.cure.starts_with(command)) one.cure = command + limits;
  }
}

}  // namespace

std::vector<Finding> judge(const Facts& facts) {
  std::vector<Finding> all;
  for (const Check& check : checks()) {
    const std::size_t before = all.size();
    check.judge(facts, all);
    for (std::size_t i = before; i < all.size(); ++i) all[i].check = check.name;
  }
  merge_cures_of_limits(facts, all);
  return all;
}

std::string command_of(const Request& request) {
  std::string text = "subworld doctor";
  if (!request.scene.empty()) text += " " + request.scene;
  if (request.domain) text += fmt::format(" --domain {}", *request.domain);
  if (!request.network.interface_address.empty()) text += " --interface " + request.network.interface_address;
  if (!request.network.peers.empty()) text += fmt::format(" --peers {}", joined(request.network.peers, ","));
  if (request.dds != "fastdds") text += " --dds " + request.dds;
  if (!request.network.qos_file.empty()) text += " --qos " + request.network.qos_file;
  if (!request.out.empty()) text += " --out " + request.out;
  return text;
}

std::string raise_limit(const Facts& facts, const std::string& limit, const std::string& value) {
  const std::string command = command_for_limits(facts);
  if (facts.machine.may_raise_limits) return fmt::format("{} --{}={}", command, limit, value);
  return fmt::format("{} --ulimit {}={}", command, limit, value == "unlimited" ? "-1" : value);
}

const Interface* own_interface(const Facts& facts) {
  const std::string& wanted = facts.request.network.interface_address;
  if (wanted.empty()) return nullptr;
  for (const Interface& one : facts.network.interfaces) {
    if (one.name == wanted || one.address == wanted) return &one;
  }
  return nullptr;
}

}  // namespace subworld::doctor
