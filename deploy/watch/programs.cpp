#include "watch/programs.hpp"

#include <fmt/core.h>
#include <pwd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string_view>
#include <system_error>

namespace subworld {

namespace {

namespace files = std::filesystem;

constexpr std::array<std::string_view, 4> kPrograms{"world_sim", "haptic_sim", "device_sim", "gui_headless"};
constexpr std::string_view kDeleted = " (deleted)";

/// Ids of all processes.
std::vector<pid_t> process_ids() {
  std::vector<pid_t> ids;
  std::error_code ignored;
  for (const auto& entry : files::directory_iterator("/proc", ignored)) {
    const std::string name = entry.path().filename();
    pid_t id = 0;
    if (const auto end = std::from_chars(name.data(), name.data() + name.size(), id);
        end.ptr == name.data() + name.size())
      ids.push_back(id);
  }
  return ids;
}

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, at);) parts.push_back(part);
  return parts;
}

std::string link_target(const std::string& link) {
  std::error_code ignored;
  return files::read_symlink(link, ignored).string();
}

/// State letter and start of a process, from the fields after its name in /proc/PID/stat.
void read_stat(const std::string& folder, RunningProgram& program) {
  const std::string text = file_text(folder + "/stat");
  const std::size_t after = text.rfind(')');
  if (after == std::string::npos) return;
  const std::vector<std::string> fields = split(text.substr(std::min(after + 2, text.size())), ' ');
  constexpr std::size_t kState = 0, kStart = 19;
  if (fields.size() <= kStart) return;
  program.suspended = fields[kState] == "T";
  const double started_s = std::strtod(fields[kStart].c_str(), nullptr) / static_cast<double>(sysconf(_SC_CLK_TCK));
  program.age_s = std::strtod(file_text("/proc/uptime").c_str(), nullptr) - started_s;
}

void read_settings(const std::string& folder, RunningProgram& program) {
  std::optional<std::string> domain = value_of(program.words, "--domain"), dds = value_of(program.words, "--dds");
  for (const std::string& variable : split(file_text(folder + "/environ"), '\0')) {
    if (!domain && variable.starts_with("SUBWORLD_DOMAIN=")) domain = variable.substr(variable.find('=') + 1);
    if (!dds && variable.starts_with("SUBWORLD_DDS=")) dds = variable.substr(variable.find('=') + 1);
  }
  if (domain) program.domain = std::atoi(domain->c_str());
  program.user = std::atoi(value_of(program.words, "--user").value_or("0").c_str());
  program.network.domain = program.domain;
  program.network.dds = dds.value_or("fastdds");
  program.network.interface_address = value_of(program.words, "--interface").value_or("");
  program.network.qos_file = value_of(program.words, "--qos").value_or("");
  program.network.peers = split(value_of(program.words, "--peers").value_or(""), ',');
}

std::optional<RunningProgram> read_program(pid_t pid) {
  const std::string folder = fmt::format("/proc/{}", pid);
  RunningProgram program{.pid = pid};
  program.words = split(file_text(folder + "/cmdline"), '\0');
  if (program.words.empty()) return {};
  program.name = files::path(program.words.front()).filename();
  if (std::ranges::find(kPrograms, program.name) == kPrograms.end()) return {};
  const std::string theirs = link_target(folder + "/ns/net");
  if (!theirs.empty() && theirs != link_target("/proc/self/ns/net")) return {};
  program.file = link_target(folder + "/exe");
  program.file_replaced = program.file.ends_with(kDeleted);
  if (program.file_replaced) program.file.resize(program.file.size() - kDeleted.size());
  read_stat(folder, program);
  read_settings(folder, program);
  return program;
}

}  // namespace

std::string file_text(const std::string& file) {
  const std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

std::optional<std::string> value_of(const std::vector<std::string>& words, const std::string& option) {
  std::optional<std::string> value;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (words[i] == option && i + 1 < words.size()) value = words[i + 1];
    if (words[i].starts_with(option + "=")) value = words[i].substr(option.size() + 1);
  }
  return value;
}

std::string label_of(const RunningProgram& program) {
  return program.name == "haptic_sim" || program.name == "device_sim" ? fmt::format("{} {}", program.name, program.user)
                                                                      : program.name;
}

std::vector<RunningProgram> running_programs() {
  std::vector<RunningProgram> found;
  for (const pid_t pid : process_ids()) {
    if (auto program = read_program(pid)) found.push_back(std::move(*program));
  }
  std::ranges::sort(found, {}, [](const RunningProgram& one) { return std::pair{-one.age_s, one.pid}; });
  return found;
}

std::vector<ClaimedDomain> claimed_domains() {
  std::vector<ClaimedDomain> claimed;
  for (const BoundPort& one : bound_udp_ports()) {
    const int domain = (one.port - claim_port(0)) / kPortsOfDomain;
    if (one.port != claim_port(domain)) continue;
    const auto owner = owner_of_socket(one.inode);
    if (!owner || owner->second.starts_with("subworld")) claimed.push_back({domain, owner ? owner->first : 0});
  }
  std::ranges::sort(claimed, {}, &ClaimedDomain::domain);
  return claimed;
}

std::vector<BoundPort> bound_udp_ports() {
  std::vector<BoundPort> ports;
  for (const std::string& line : split(file_text("/proc/net/udp"), '\n')) {
    std::istringstream words(line);
    std::string slot, local, remote, state, queues, timer, unanswered, timeout;
    BoundPort bound;
    if (!(words >> slot >> local >> remote >> state >> queues >> timer >> unanswered >> bound.user >> timeout >>
          bound.inode))
      continue;
    const std::size_t colon = local.find(':');
    if (colon == std::string::npos) continue;
    bound.port = static_cast<int>(std::strtol(local.c_str() + colon + 1, nullptr, 16));
    ports.push_back(bound);
  }
  return ports;
}

bool uses_domain(const std::vector<BoundPort>& ports, int domain) {
  const int first = first_port(domain);
  return std::ranges::any_of(
      ports, [&](const BoundPort& one) { return one.port >= first && one.port < first + kPortsOfDomain; });
}

std::optional<std::pair<pid_t, std::string>> owner_of_socket(std::uint64_t inode) {
  const std::string wanted = fmt::format("socket:[{}]", inode);
  for (const pid_t pid : process_ids()) {
    std::error_code hidden;
    for (const auto& entry : files::directory_iterator(fmt::format("/proc/{}/fd", pid), hidden)) {
      if (link_target(entry.path()) != wanted) continue;
      std::string name = file_text(fmt::format("/proc/{}/comm", pid));
      if (name.ends_with('\n')) name.pop_back();
      return std::pair{pid, name};
    }
  }
  return {};
}

std::string owner_text(const BoundPort& bound) {
  if (const auto owner = owner_of_socket(bound.inode))
    return fmt::format("{} (process {})", owner->second, owner->first);
  const passwd* user = getpwuid(bound.user);
  return fmt::format("a program of user {}", user == nullptr ? std::to_string(bound.user) : user->pw_name);
}

std::set<std::string> files_in_use(const std::string& folder) {
  std::set<std::string> used;
  const auto add = [&](const std::string& file) {
    if (file.starts_with(folder + "/")) used.insert(file);
  };
  for (const pid_t pid : process_ids()) {
    const std::string process = fmt::format("/proc/{}", pid);
    for (const std::string& line : split(file_text(process + "/maps"), '\n')) {
      if (const std::size_t at = line.find(folder + "/"); at != std::string::npos) add(line.substr(at));
    }
    std::error_code hidden;
    for (const auto& entry : files::directory_iterator(process + "/fd", hidden)) add(link_target(entry.path()));
  }
  return used;
}

}  // namespace subworld
