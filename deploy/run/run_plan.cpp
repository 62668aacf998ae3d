#include "run/run_plan.hpp"

#include "io/results/output.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"
#include "model/places.hpp"
#include "plan/limits.hpp"
#include "run/claim.hpp"
#include "run/page.hpp"
#include "tools.hpp"
#include "wire/bus.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <iterator>
#include <map>
#include <string_view>
#include <utility>

namespace subworld {

namespace {

/// The vendor of the program at a position among those of a run; with "mixed" they alternate.
std::string vendor_of(const std::string& dds, int position) {
  if (dds != "mixed") return dds;
  return position % 2 == 0 ? "fastdds" : "cyclonedds";
}

std::string ros2_program() { return (program_folder() / "subworld_ros2").string(); }

}  // namespace

bool RunPlan::is_distant(const SessionHost& host) const {
  return !request.namespaces && request.host.empty() && !host.ssh.empty();
}

bool RunPlan::all_here() const {
  const auto distant = [&](const SessionHost& host) { return is_distant(host); };
  return request.host.empty() && std::ranges::none_of(session.hosts, distant);
}

bool RunPlan::starts(const RunProgram& program) const {
  return !request.host.empty() || std::ranges::count(request.options.without, program.user) == 0;
}

void RunPlan::each_program(const std::function<void(const RunProgram&, const std::string&)>& start) const {
  int position = 0;
  const auto take = [&](const RunProgram& program) { start(program, vendor_of(session.dds, position++)); };
  take({"world_sim"});
  for (int user = 0; session.runs({"haptic_sim", user}); ++user) {
    take({"haptic_sim", user});
    take({"device_sim", user});
    if (session.runs({"haptic_sim", 1})) ++position;  // with mixed, users have different pairs of vendors
  }
  take({"gui_headless"});
}

std::vector<std::string> RunPlan::parts() const {
  std::vector<std::string> parts;
  each_program([&](const RunProgram& program, const std::string&) {
    if (program.name != "gui_headless" && starts(program))
      parts.push_back(part_file(request.options.out, program.name, program.user));
  });
  return parts;
}

namespace {

/// The most whose programs run on one host; hosts of one address are one.
int users_of_a_host(const Session& session) {
  std::map<std::string, std::ptrdiff_t> programs;
  for (const SessionHost& host : session.hosts) {
    const bool here = !host.address.empty() && !is_remote(host.address);
    const std::string& where = host.address.empty() ? host.name : host.address;
    const auto of_user = [](const RunProgram& program) { return program.user >= 0; };
    programs[here ? "" : where] += std::ranges::count_if(host.programs, of_user);
  }
  std::ptrdiff_t most = 0;
  for (const auto& [where, count] : programs) most = std::max(most, count);
  return static_cast<int>((most + 1) / 2);  // a user has two
}

}  // namespace

std::vector<std::string> RunPlan::flags_of(const Host& host, const RunProgram& program,
                                           const std::string& vendor) const {
  const Options& options = request.options;
  const bool world = program.name == "world_sim";
  std::vector<std::string> flags = settings_flags_of(options);
  const auto add = [&](const char* flag, const std::string& value) {
    if (!value.empty()) flags.insert(flags.end(), {flag, value});
  };
  add("--out", host.folder());
  add("--domain", std::to_string(session.domain));
  add("--dds", vendor);
  add("--interface", host.plan().network_interface);
  add("--peers", joined(peers_of(host.plan()), ","));
  if (session.has_file()) add("--host-users", std::to_string(users_of_a_host(session)));
  if (program.user >= 0) add("--user", std::to_string(program.user));
  if (!options.trace.empty() && program.name != "gui_headless") add("--trace", trace_part(host.folder(), program));
  if (world) add("--resume", options.resume);
  if (world && (request.gui || request.ros_domain >= 0)) flags.emplace_back("--await-display");
  std::ranges::move(own_flags_of(options, program.name, program.user), std::back_inserter(flags));
  if (!is_placed_by_hand(program.name)) add("--core", to_text(placement.of(program.name)));
  return flags;
}

Command RunPlan::ros2() const {
  Command command{ros2_program(), settings_flags_of(request.options)};
  const auto add = [&](const char* flag, std::string value) {
    command.arguments.insert(command.arguments.end(), {flag, std::move(value)});
  };
  add("--ros-domain", std::to_string(request.ros_domain));
  add("--domain", std::to_string(session.domain));
  add("--dds", vendor_of(session.dds, 0));
  // Users with the device `udp` follow ROS 2.
  std::vector<std::string> driven;
  for (int user = 0; session.runs({"haptic_sim", user}); ++user) {
    if (std::ranges::count(device_flags_of(request.options, user), "udp") > 0) driven.push_back(std::to_string(user));
  }
  if (driven.empty()) return command;
  add("--drive", joined(driven, ","));
  constexpr std::string_view kPort = "port=";
  const std::string& settings = request.options.device_settings;
  if (const std::size_t at = settings.find(kPort); at != std::string::npos)
    add("--port", std::to_string(std::atoi(&settings[at + kPort.size()]) - std::stoi(driven.front())));
  return command;
}

std::vector<std::string> RunPlan::peers_of(const SessionHost& host) const {
  std::vector<std::string> peers;
  for (const SessionHost& other : session.hosts) {
    if (other.name != host.name && !other.address.empty()) peers.push_back(other.address);
  }
  return peers;
}

Network RunPlan::network_of(const SessionHost& host) const {
  Network network = request.options.network;
  network.dds = host.dds.empty() ? vendor_of(session.dds, 0) : host.dds;
  network.domain = session.domain;
  if (session.has_file()) {
    network.interface_address = host.network_interface;
    network.peers = peers_of(host);
    network.host_users = users_of_a_host(session);
  }
  return network;
}

/// Each program that starts here finds its keys, and they are sound.
void check_secure(const RunPlan& plan) {
  const std::string& folder = plan.request.options.network.secure;
  if (folder.empty()) return;
  if (plan.session.vendors() == "mixed")
    throw Error(ExitCode::usage,
                "--secure with --dds mixed: the keys that the two vendors offer each other do not fit; use one vendor");
  check_keys(folder, "subworld");
  if (!plan.all_here()) return;
  std::string roles = "subworld";
  plan.each_program([&](const RunProgram& program, const std::string&) {
    if (program.name == "gui_headless" && !plan.request.gui) return;
    check_keys(folder, program.label());
    roles += "," + program.label();
  });
  const std::string tool = (program_folder() / "subworld_keys").string();
  const bool can_check = access(tool.c_str(), X_OK) == 0 && !first_line_of("command -v openssl").empty();
  if (!can_check) return;  // the vendors have libraries of their own
  const std::string fault =
      first_line_of(fmt::format("{} check {} --role {} 2>&1", shell_word(tool), shell_word(folder), roles));
  if (!fault.ends_with("nothing is wrong"))
    throw Error(ExitCode::usage, fmt::format("--secure {0}: {1}; `subworld keys check {0}` lists all faults, and "
                                             "`subworld keys make NEW --users N` makes new keys",
                                             folder, fault));
}

RunPlan plan_run(const RunRequest& given, Scene& scene) {
  RunPlan plan{given, {}, {}};
  RunRequest& request = plan.request;
  if (!request.session.empty()) {
    plan.session = load_session(request);
    request.options = plan.session.options;
    for (const auto file : {&Options::out, &Options::record, &Options::trace})
      request.options.*file = given.options.*file;
    request.dds = plan.session.vendors();
    request.gui = plan.session.runs({"gui_headless"});
  }
  Options& options = request.options;
  scene = load_scene(options);
  if (request.session.empty()) plan.session = session_of_this_machine(request, scene);
  check_programs(plan.session, scene);
  check_request(scene, request, users_of_a_host(plan.session));
  for (const int position : {0, 1}) {  // with mixed, both vendors
    Network network = options.network;
    network.dds = vendor_of(request.dds, position);
    check_network(network);
  }
  check_secure(plan);
  if (request.ros_domain >= 0 && access(ros2_program().c_str(), X_OK) != 0)
    throw Error(ExitCode::failed,
                fmt::format("--ros2: {} is missing; build it with deploy/build tools", ros2_program()));
  check_resume(options);
  check_without(options, scene);
  if (request.page || request.session.empty()) choose_live_port(options.live, request.page);
  return plan;
}

std::string trace_part(const std::string& folder, const RunProgram& program) {
  return fmt::format("{}/trace_{}.json", folder, program.label());
}

}  // namespace subworld
