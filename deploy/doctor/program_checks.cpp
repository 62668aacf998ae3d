#include "doctor/checks.hpp"
#include "model/joined.hpp"
#include "model/settings/settings.hpp"
#include "wire/session.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <string_view>

namespace subworld::doctor {

namespace {

/// Programs of this machine on the domain that is examined.
std::vector<RunningProgram> programs_here(const Facts& facts) {
  std::vector<RunningProgram> here;
  for (const RunningProgram& one : facts.domain.programs) {
    if (one.domain == facts.domain.number) here.push_back(one);
  }
  return here;
}

const RunningProgram* world_among(const std::vector<RunningProgram>& programs) {
  const auto found = std::ranges::find(programs, "world_sim", &RunningProgram::name);
  return found == programs.end() ? nullptr : &*found;
}

std::string quoted(const std::string& word) {
  constexpr std::string_view kPlain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_./=,:@%+";
  return !word.empty() && word.find_first_not_of(kPlain) == std::string::npos ? word : shell_word(word);
}

/// Options of a command line that belong to one program of a run, or to its host.
constexpr std::array<std::string_view, 12> kOwnOptions{"--out",       "--bodies", "--bodies-rate", "--checkpoint",
                                                       "--resume",    "--trace",  "--core",        "--spin",
                                                       "--interface", "--peers",  "--dds",         "--qos"};
constexpr std::array<std::string_view, 4> kHostOptions{"--interface", "--peers", "--dds", "--qos"};

/// The command that starts a program of the run of this world, on the same host.
std::string command_like(const RunningProgram& world, const std::string& program, int user,
                         const std::vector<std::string>& host_words) {
  std::string command = (std::filesystem::path(world.words.front()).parent_path() / program).string();
  for (std::size_t i = 1; i < world.words.size(); ++i) {
    const std::string& word = world.words[i];
    const std::string option = word.substr(0, word.find('='));
    if (option == "--await-display") continue;
    if (std::ranges::find(kOwnOptions, option) != kOwnOptions.end()) {
      i += option == word ? 1U : 0U;
      continue;
    }
    command += " " + quoted(word);
  }
  for (const std::string_view option : kHostOptions) {
    if (const auto value = value_of(host_words, std::string(option)))
      command += fmt::format(" {} {}", option, quoted(*value));
  }
  if (program == "haptic_sim" || program == "device_sim") command += fmt::format(" --user {}", user);
  return command;
}

bool has_finding(const Findings& findings, std::initializer_list<std::string_view> checks) {
  return std::ranges::any_of(findings,
                             [&](const Finding& one) { return std::ranges::find(checks, one.check) != checks.end(); });
}

void judge_suspended(const Facts& facts, Findings& out) {
  for (const RunningProgram& one : facts.domain.programs) {
    if (!one.suspended) continue;
    out.push_back({.what = fmt::format("{} (process {}, domain {}) is suspended", label_of(one), one.pid, one.domain),
                   .why =
                       "the other programs take it for dead after two seconds, and the run ends; Ctrl-Z or a debugger "
                       "suspends",
                   .cure = fmt::format("kill -CONT {}", one.pid)});
  }
}

void judge_replaced(const Facts& facts, Findings& out) {
  for (const RunningProgram& one : programs_here(facts)) {
    if (!one.file_replaced) continue;
    out.push_back({.what = fmt::format("{} (process {}) runs from {}, which has been replaced since", label_of(one),
                                       one.pid, one.file),
                   .why = "programs that start now are of another build, and may not understand its messages",
                   .cure = fmt::format("kill {}  # and start it anew", one.pid)});
  }
}

void judge_worlds(const Facts& facts, Findings& out) {
  std::vector<RunningProgram> worlds = programs_here(facts);
  std::erase_if(worlds, [](const RunningProgram& one) { return one.name != "world_sim"; });
  const auto count = std::max<std::size_t>(static_cast<std::size_t>(std::max(facts.domain.worlds, 0)), worlds.size());
  if (count < 2) return;
  const bool known = worlds.size() >= 2;
  out.push_back({.what = known ? fmt::format("{} worlds are on domain {}: the processes {} and {}", count,
                                             *facts.domain.number, worlds.front().pid, worlds.back().pid)
                               : fmt::format("{} worlds are on domain {}", count, *facts.domain.number),
                 .why = "a run has one world; programs refuse the messages of the other one, or end",
                 .cure = known ? fmt::format("kill {}", worlds.back().pid)
                               : fmt::format("subworld control stop --domain {}", *facts.domain.number)});
}

/// Programs that wait on a domain without a world, while a world on another one lacks them. Peers may have theirs.
std::vector<RunningProgram> strayed(const Facts& facts, const RunningProgram& world) {
  std::vector<RunningProgram> found;
  const auto& all = facts.domain.programs;
  for (const RunningProgram& one : all) {
    const bool has_world = std::ranges::any_of(
        all, [&](const RunningProgram& other) { return other.name == "world_sim" && other.domain == one.domain; });
    const bool is_lacking = std::ranges::none_of(all, [&](const RunningProgram& other) {
      return other.domain == world.domain && label_of(other) == label_of(one);
    });
    if (!has_world && one.domain != world.domain && is_lacking && one.network.peers.empty()) found.push_back(one);
  }
  return found;
}

void judge_strayed(const Facts& facts, Findings& out) {
  const RunningProgram* world = world_among(facts.domain.programs);
  if (world == nullptr) return;
  for (const RunningProgram& one : strayed(facts, *world)) {
    out.push_back({.what = fmt::format("{} (process {}) is on domain {}, which has no world; a world is on domain {}",
                                       label_of(one), one.pid, one.domain, world->domain),
                   .why = "it waits, and ends when --wait is over",
                   .cure = fmt::format("kill {}; {}", one.pid, command_like(*world, one.name, one.user, one.words))});
  }
}

/// The value of a setting on a command line.
std::string setting_in(const std::vector<std::string>& words, const Setting& setting) {
  const std::string set = "--set";
  std::string value =
      (setting.option.empty() ? std::nullopt : value_of(words, std::string(setting.option))).value_or("(the scene's)");
  for (std::size_t i = 1; i + 1 < words.size(); ++i) {
    const SettingChange change = parse_change(words[i + 1]);
    if (words[i] == set && change.key == setting.key) value = change.value;
  }
  return value;
}

/// "--mode lockstep instead of realtime", for all options that differ.
std::string difference(const RunningProgram& one, const RunningProgram& world) {
  std::vector<std::string> differ;
  const auto compare = [&](const std::string& name, const std::string& mine, const std::string& theirs) {
    if (mine != theirs) differ.push_back(fmt::format("{} {} instead of {}", name, mine, theirs));
  };
  if (one.words.size() > 1 && world.words.size() > 1 && !one.words[1].starts_with("-") &&
      !world.words[1].starts_with("-"))
    compare("scene", std::filesystem::path(one.words[1]).stem(), std::filesystem::path(world.words[1]).stem());
  for (const Setting& setting : settings_table()) {
    compare(setting.option.empty() ? "--set " + setting.key : std::string(setting.option),
            setting_in(one.words, setting), setting_in(world.words, setting));
  }
  return joined(differ, ", ");
}

void judge_flags(const Facts& facts, Findings& out) {
  const std::vector<RunningProgram> here = programs_here(facts);
  const RunningProgram* world = world_among(here);
  if (world == nullptr) return;
  for (const RunningProgram& one : here) {
    const std::string differs = one.name == "gui_headless" ? "" : difference(one, *world);
    if (differs.empty() || one.name == "world_sim") continue;
    out.push_back(
        {.what = fmt::format("{} (process {}) has other flags than the world: {}", label_of(one), one.pid, differs),
         .why = "the settings of a run must be the same in all programs: it is refused, or nothing is delivered",
         .cure = fmt::format("kill {}; {}", one.pid, command_like(*world, one.name, one.user, one.words))});
  }
}

/// The interface of a program, by its name.
std::string interface_of(const Facts& facts, const std::string& given) {
  for (const Interface& one : facts.network.interfaces) {
    if (given == one.name || given == one.address || (given.empty() && one.loopback)) return one.name;
  }
  return given;
}

void judge_interfaces(const Facts& facts, Findings& out) {
  const std::vector<RunningProgram> here = programs_here(facts);
  const RunningProgram* world = world_among(here);
  if (world == nullptr) return;
  const std::string worlds = interface_of(facts, world->network.interface_address);
  for (const RunningProgram& one : here) {
    const std::string own = interface_of(facts, one.network.interface_address);
    if (own == worlds || !one.network.qos_file.empty() || !world->network.qos_file.empty()) continue;
    out.push_back(
        {.what = fmt::format("{} (process {}) is on the interface {}, the world on {}", label_of(one), one.pid, own,
                             worlds),
         .why = "they do not find each other",
         .cure = fmt::format("kill {}; {}", one.pid, command_like(*world, one.name, one.user, world->words))});
  }
}

const Status* status_of(const Facts& facts, const std::string& label) {
  const auto found = std::ranges::find_if(
      facts.domain.statuses, [&](const Status& one) { return label_of(one.program, one.instance) == label; });
  return found == facts.domain.statuses.end() ? nullptr : &*found;
}

/// Programs of the run that are neither received nor running here.
std::vector<std::pair<std::string, int>> missing_programs(const Facts& facts, const std::vector<RunningProgram>& here) {
  std::vector<std::pair<std::string, int>> missing;
  const auto look = [&](const char* name, ProgramKind kind, std::uint32_t instance) {
    const std::string label = label_of(kind, instance);
    const bool running = std::ranges::any_of(here, [&](const RunningProgram& one) { return label_of(one) == label; });
    if (!running && status_of(facts, label) == nullptr) missing.emplace_back(name, static_cast<int>(instance));
  };
  look("world_sim", ProgramKind::world_sim, 0);
  for (std::uint32_t user = 0; user < facts.domain.users.value_or(0); ++user) {
    look("haptic_sim", ProgramKind::haptic_sim, user);
    look("device_sim", ProgramKind::device_sim, user);
  }
  return missing;
}

void judge_first_samples(const Facts& facts, Findings& out) {
  const auto& statuses = facts.domain.statuses;
  const bool waits = std::ranges::any_of(statuses, [](const Status& one) { return one.state == "waiting"; });
  if (!waits || has_finding(out, {"worlds", "strayed"})) return;
  const std::vector<RunningProgram> here = programs_here(facts);
  const RunningProgram* model = world_among(here);
  if (model == nullptr && !here.empty()) model = &here.front();
  for (const auto& [name, user] : missing_programs(facts, here)) {
    const std::string label = name == "world_sim" ? name : fmt::format("{} {}", name, user);
    const char* topic = name == "world_sim" ? "scene" : name == "haptic_sim" ? "haptic_report" : "device_state";
    out.push_back({.what = fmt::format("{} is missing on domain {}: the topic {} has no first sample", label,
                                       *facts.domain.number, topic),
                   .why = "the other programs wait for it, and end when --wait is over",
                   .cure = model != nullptr
                               ? command_like(*model, name, user, model->words)
                               : fmt::format("{} {} --domain {}{}", name, facts.domain.scene, *facts.domain.number,
                                             name == "world_sim" ? "" : fmt::format(" --user {}", user))});
  }
}

/// The counts of a program hold all that it has met since it started: they matter where a run does not begin. Differing
/// flags are the usual cause, and have a finding of their own.
void judge_qos(const Facts& facts, Findings& out) {
  const bool waits =
      std::ranges::any_of(facts.domain.statuses, [](const Status& one) { return one.state == "waiting"; });
  if (!waits || has_finding(out, {"flags", "worlds"})) return;
  for (const Status& one : facts.domain.statuses) {
    if (one.events.incompatible_qos == 0) continue;
    out.push_back(
        {.what = fmt::format("{} has matched {} endpoints with incompatible quality of service",
                             label_of(one.program, one.instance), one.events.incompatible_qos),
         .why = "nothing is delivered between them: a program of the run has another --mode, --ratio or h_s",
         .cure = fmt::format("subworld control stop --domain {}  # and start all programs with the same flags",
                             *facts.domain.number)});
    return;
  }
}

constexpr std::array kProgramChecks{
    Check{"suspended", "no program of Subworld is suspended", judge_suspended},
    Check{"replaced", "no program of the domain runs from a file that was replaced since", judge_replaced},
    Check{"worlds", "the domain has one world", judge_worlds},
    Check{"strayed", "no program waits on a domain without a world while a world is on another", judge_strayed},
    Check{"flags", "all programs of the domain have the flags of its world (this machine)", judge_flags},
    Check{"interfaces", "all programs of the domain are on the interface of its world (this machine)",
          judge_interfaces},
    Check{"first_samples", "a world that waits has a haptic_sim and a device_sim for each user", judge_first_samples},
    Check{"incompatible_qos", "no program has matched endpoints of incompatible quality of service", judge_qos}};

}  // namespace

std::span<const Check> program_checks() { return kProgramChecks; }

}  // namespace subworld::doctor
