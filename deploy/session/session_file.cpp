#include "session/session_file.hpp"

#include "model/error.hpp"
#include "model/joined.hpp"
#include "model/places.hpp"
#include "model/scene/yaml_reader.hpp"
#include "model/shapes/nearest.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <set>

namespace subworld {

namespace {

constexpr std::array kOfSessions{"world_sim", "haptic_sim", "device_sim", "gui_headless"};

bool is_of_user(std::string_view program) { return program == "haptic_sim" || program == "device_sim"; }

/// "haptic_sim 0" or "world_sim".
RunProgram read_program(const YamlValue& value) {
  const std::string text = value.text();
  const std::size_t space = text.find(' ');
  RunProgram program{text.substr(0, space)};
  if (std::ranges::find(kOfSessions, program.name) == kOfSessions.end()) {
    value.fail(fmt::format("there is no program \"{}\"; did you mean \"{}\"?", program.name,
                           nearest(program.name, {kOfSessions.begin(), kOfSessions.end()})));
  }
  if (!is_of_user(program.name)) {
    if (space != std::string::npos) value.fail(fmt::format("{} has no user; write {}", program.name, program.name));
    return program;
  }
  const std::string user = space == std::string::npos ? "" : text.substr(space + 1);
  const auto [end, error] = std::from_chars(user.data(), user.data() + user.size(), program.user);
  if (error != std::errc{} || end != user.data() + user.size() || program.user < 0 || program.user >= kMostUsers)
    value.fail(fmt::format("{0} needs the number of its user, from 0; for example: {0} 0", program.name));
  return program;
}

SessionHost read_host(const YamlValue& value) {
  const YamlMap map(value, {"name", "address", "interface", "ssh", "folder", "dds", "programs"});
  SessionHost host;
  host.name = map.at("name").name();
  map.read("address", host.address);
  map.read("interface", host.network_interface);
  map.read("ssh", host.ssh);
  map.read("folder", host.folder);
  if (const auto dds = map.find("dds"))
    host.dds = std::array{"fastdds", "cyclonedds"}[dds->choice({"fastdds", "cyclonedds"})];
  for (const YamlValue& program : map.at("programs").items()) host.programs.push_back(read_program(program));
  if (host.programs.empty()) map.at("programs").fail("is empty; name a program, for example: [world_sim]");
  return host;
}

/// Flags of `subworld run`, as a map of names without dashes: {mode: lockstep, ratio: 4-12}.
Options read_options(const YamlMap& map) {
  std::vector<std::string> words{"subworld", map.at("scene").text()};
  const auto flags = map.find("flags");
  if (flags) {
    for (const YamlValue::Named& flag : flags->entries()) {
      if (flag.value.is_scalar()) {
        words.insert(words.end(), {"--" + flag.key, flag.value.text()});
      } else {
        for (const YamlValue& item : flag.value.items()) words.insert(words.end(), {"--" + flag.key, item.text()});
      }
    }
  }
  std::vector<const char*> argv;
  for (const std::string& word : words) argv.push_back(word.c_str());
  Options options;
  CommandLine line("subworld run", "");
  add_run_options(line, options);
  add_device_options(line, options);
  add_live_options(line, options.live, "");
  add_bodies_options(line, options);
  add_checkpoint_options(line, options);
  std::optional<int> ros_domain;
  line.add("--ros2", &ros_domain, "");
  try {
    (void)line.parse(static_cast<int>(argv.size()), argv.data());
    (void)imply_browser(options);
  } catch (const Error& wrong) {
    (flags ? *flags : map.whole()).fail(wrong.what());
  }
  for (const auto& [set, flag, instead] :
       {std::tuple{!options.network.interface_address.empty(), "interface", "the interface of each host"},
        std::tuple{options.network.host_users > 0, "host-users", "the programs of each host"},
        std::tuple{!options.network.peers.empty(), "peers", "the address of each host"},
        std::tuple{ros_domain.has_value(), "ros2", "`subworld ros2` on one of the hosts"},
        std::tuple{!options.resume.empty(), "resume", "--restart on-failure, with which a world goes on by itself"}}) {
    if (set) flags->fail(fmt::format("{} is not a flag of a session; use {}", flag, instead));
  }
  return options;
}

}  // namespace

std::string RunProgram::label() const { return user < 0 ? name : fmt::format("{}_{}", name, user); }

std::string Session::vendors() const {
  std::set<std::string> used;
  for (const SessionHost& host : hosts) used.insert(host.dds.empty() ? dds : host.dds);
  return used.size() == 1 ? *used.begin() : "mixed";
}

bool SessionHost::runs(const RunProgram& program) const { return std::ranges::count(programs, program) > 0; }

bool Session::runs(const RunProgram& program) const {
  return std::ranges::any_of(hosts, [&](const SessionHost& host) { return host.runs(program); });
}

namespace {

/// The file that a command line gives by its path, or by its name in the folder of sessions.
std::string session_file(const std::string& session) {
  namespace fs = std::filesystem;
  std::error_code unreadable;  // reading the file reports the reason
  const fs::path folder = data_folder("sessions");
  if (fs::exists(session, unreadable) || session.find('/') != std::string::npos || !fs::is_directory(folder))
    return session;
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == ".yaml") names.push_back(entry.path().stem().string());
  }
  std::ranges::sort(names);
  if (std::ranges::find(names, session) != names.end()) return (folder / (session + ".yaml")).string();
  throw Error(ExitCode::usage, fmt::format("\"{}\" is neither a file nor the name of a session in {}; those are {}",
                                           session, folder.string(), joined(names, ", ")));
}

Session read_session(const std::string& file) {
  const YamlNode node = read_yaml(file);
  const YamlMap map(YamlValue(file, "", node, node.mark),
                    {"name", "description", "scene", "flags", "dds", "domain", "link", "hosts"});
  Session session;
  session.file = file;
  session.name = map.at("name").name();
  session.options = read_options(map);
  if (const auto dds = map.find("dds"))
    session.dds = std::array{"fastdds", "cyclonedds", "mixed"}[dds->choice({"fastdds", "cyclonedds", "mixed"})];
  map.read("domain", session.domain, 0, 232);
  map.read("link", session.link);
  for (const YamlValue& value : map.at("hosts").items()) {
    session.hosts.push_back(read_host(value));
    const auto same = [&](const SessionHost& host) { return host.name == session.hosts.back().name; };
    if (std::ranges::count_if(session.hosts, same) > 1)
      value.fail(fmt::format("there are two hosts \"{}\"; give each its own name", session.hosts.back().name));
  }
  return session;
}

/// Throws `Error` (usage) where a host cannot find the others.
void check_addresses(const Session& session) {
  if (session.hosts.size() < 2) return;
  for (const SessionHost& host : session.hosts) {
    if (!host.address.empty() && !host.network_interface.empty()) continue;
    throw Error(ExitCode::usage,
                fmt::format("{}: host {} has no {}; add it, or run all hosts on this machine: --namespaces",
                            session.file, host.name, host.address.empty() ? "address" : "interface"));
  }
}

/// Throws `Error` (usage) for options that do not fit the session, or each other.
void check_hosts(const Session& session, const RunRequest& request) {
  if (!request.namespaces) check_addresses(session);
  if (request.host.empty()) return;
  if (std::ranges::find(session.hosts, request.host, &SessionHost::name) == session.hosts.end()) {
    std::vector<std::string> names;
    for (const SessionHost& host : session.hosts) names.push_back(host.name);
    throw Error(ExitCode::usage, fmt::format("--host {}: {} has no such host; it has {}", request.host, session.file,
                                             joined(names, ", ")));
  }
  if (request.namespaces) {
    throw Error(
        ExitCode::usage,
        "--host and --namespaces exclude each other: namespaces connect hosts of one command; run all hosts here "
        "with --namespaces alone, or one of several machines with --host alone");
  }
  if (!request.options.record.empty()) {
    throw Error(ExitCode::usage,
                "--host and --record exclude each other: a recording has the messages of all hosts; "
                "start all hosts with one command, without --host");
  }
}

/// The display passes the poses of a page on to the device by a socket of their host.
void check_browser(const Session& session, int user) {
  const std::vector<std::string> flags = device_flags_of(session.options, user);
  if (flags.empty() || flags[1] != kBrowserDevice) return;
  const auto serves = [&](const SessionHost& host) {
    return host.runs({"device_sim", user}) && host.runs({"gui_headless"});
  };
  if (session.options.live.port && std::ranges::any_of(session.hosts, serves)) return;
  throw Error(ExitCode::usage,
              fmt::format("{}: user {} has the device browser, whose page the display serves on the same host; add the "
                          "flag live, and gui_headless to the programs of the host with device_sim {}",
                          session.file, user, user));
}

}  // namespace

Session load_session(const RunRequest& request) {
  Session session = read_session(session_file(request.session));
  check_hosts(session, request);
  if (!request.dds.empty()) {
    session.dds = request.dds;
    for (SessionHost& host : session.hosts) host.dds.clear();
  }
  return session;
}

Session session_of_this_machine(const RunRequest& request, const Scene& scene) {
  Session session;
  session.name = scene.name;
  session.dds = request.dds;
  session.domain = request.domain;
  session.options = request.options;
  SessionHost& host = session.hosts.emplace_back();
  host.programs.push_back({"world_sim"});
  for (int user = 0; user < scene.settings.users; ++user) {
    for (const char* program : {"haptic_sim", "device_sim"}) host.programs.push_back({program, user});
  }
  if (request.gui) host.programs.push_back({"gui_headless"});
  return session;
}

void check_programs(const Session& session, const Scene& scene) {
  const auto runs = [&](const RunProgram& wanted) {
    std::ptrdiff_t count = 0;
    for (const SessionHost& host : session.hosts) count += std::ranges::count(host.programs, wanted);
    return count;
  };
  const auto check = [&](const RunProgram& wanted) {
    const std::string text = wanted.user < 0 ? wanted.name : fmt::format("{} {}", wanted.name, wanted.user);
    const std::ptrdiff_t count = runs(wanted);
    if (count == 1) return;
    throw Error(ExitCode::usage,
                count == 0 ? fmt::format("{}: no host runs {}; add it to the programs of one", session.file, text)
                           : fmt::format("{}: {} runs {} times; keep one", session.file, text, count));
  };
  check({"world_sim"});
  if (session.options.live.port) check({"gui_headless"});
  for (int user = 0; user < scene.settings.users; ++user) {
    check({"haptic_sim", user});
    check({"device_sim", user});
    check_browser(session, user);
  }
  for (const SessionHost& host : session.hosts) {
    for (const RunProgram& program : host.programs) {
      if (program.user >= scene.settings.users) {
        throw Error(
            ExitCode::usage,
            fmt::format("{}: host {} runs {} {}, but {} users take part; remove it, or set flags: {{users: {}}}",
                        session.file, host.name, program.name, program.user, scene.settings.users, program.user + 1));
      }
    }
  }
}

}  // namespace subworld
