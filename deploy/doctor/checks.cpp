#include "doctor/checks.hpp"

#include "model/joined.hpp"

#include <fmt/core.h>

#include <algorithm>

namespace subworld::doctor {

std::vector<Check> checks() {
  std::vector<Check> all;
  for (const auto part : {machine_checks(), network_checks(), program_checks()})
    all.insert(all.end(), part.begin(), part.end());
  return all;
}

Findings judge(const Facts& facts) {
  Findings all;
  for (const Check& check : checks()) {
    const std::size_t before = all.size();
    check.judge(facts, all);
    for (std::size_t i = before; i < all.size(); ++i) all[i].check = check.name;
  }
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
  if (!request.network.secure.empty()) text += " --secure " + shell_word(request.network.secure);
  return text;
}

const std::string* variable(const Facts& facts, std::string_view name) {
  const auto& all = facts.machine.environment;
  const auto found = std::ranges::find(all, name, &std::pair<std::string, std::string>::first);
  return found == all.end() ? nullptr : &found->second;
}

const Interface* own_interface(const Request& request, const NetworkFacts& network) {
  const std::string& wanted = request.network.interface_address;
  if (wanted.empty()) return nullptr;
  const auto found = std::ranges::find_if(
      network.interfaces, [&](const Interface& one) { return one.name == wanted || one.address == wanted; });
  return found == network.interfaces.end() ? nullptr : &*found;
}

}  // namespace subworld::doctor
