#include "doctor/checks.hpp"
#include "model/joined.hpp"
#include "model/nearest.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <string_view>

namespace subworld::doctor {

namespace {

using Findings = std::vector<Finding>;
using Variable = std::pair<std::string, std::string>;

const std::string* value_of_variable(const Facts& facts, std::string_view name) {
  const auto found = std::ranges::find(facts.machine.environment, name, &Variable::first);
  return found == facts.machine.environment.end() ? nullptr : &found->second;
}

void judge_programs(const Facts& facts, Findings& out) {
  std::vector<std::string> faults;
  for (const InstalledPart& part : facts.machine.parts) {
    if (!part.fault.empty() && part.name.find(' ') == std::string::npos) faults.push_back(part.fault);
  }
  if (faults.empty()) return;
  out.push_back({.what = joined(faults, "; "),
                 .why = "`subworld run` starts the programs that lie beside it, all of its own version",
                 .cure = "deploy/build demo"});
}

/// Parts of a kind that cannot be used, with the variable that can hide them.
void judge_plugins(const Facts& facts, std::string_view kind, const char* variable, const char* why,
                   const std::string& install, Findings& out) {
  std::vector<std::string> faults;
  for (const InstalledPart& part : facts.machine.parts) {
    if (!part.fault.empty() && part.name.starts_with(kind))
      faults.push_back(fmt::format("{}: {}", part.name, part.fault));
  }
  if (faults.empty()) return;
  const bool hidden = value_of_variable(facts, variable) != nullptr;
  out.push_back(
      {.what = joined(faults, "; "), .why = why, .cure = hidden ? fmt::format("unset {}", variable) : install});
}

void judge_vendors(const Facts& facts, Findings& out) {
  judge_plugins(facts, "DDS ", "SUBWORLD_PLUGIN_DIR", "without it no program can send a message", "deploy/build", out);
}

void judge_engines(const Facts& facts, Findings& out) {
  std::string missing;
  for (const InstalledPart& part : facts.machine.parts) {
    if (!part.fault.empty() && part.name.starts_with("engine ")) missing = part.name.substr(part.name.find(' ') + 1);
  }
  constexpr std::array kNeedNpm{"havok", "physx", "rapier"};
  const bool npm = std::ranges::find(kNeedNpm, missing) != kNeedNpm.end();
  judge_plugins(facts, "engine ", "SUBWORLD_ENGINES", "the scene names it, and a run ends at its start",
                fmt::format("{}deploy/build {}", npm ? "SUBWORLD_ENGINES_ALL=1 " : "", missing), out);
}

/// After "SUBWORLD_".
constexpr std::array<std::string_view, 16> kVariables{"DDS",
                                                      "DEVICES",
                                                      "TOKEN",
                                                      "DOMAIN",
                                                      "PLUGIN_DIR",
                                                      "ENGINES",
                                                      "ENGINES_ALL",
                                                      "PLACEMENT",
                                                      "WORLD_SIM_CORE",
                                                      "WORLD_SIM_SPIN_S",
                                                      "HAPTIC_SIM_CORE",
                                                      "HAPTIC_SIM_SPIN_S",
                                                      "DEVICE_SIM_CORE",
                                                      "DEVICE_SIM_SPIN_S",
                                                      "GUI_HEADLESS_CORE",
                                                      "GUI_HEADLESS_SPIN_S"};

void judge_variable_names(const Facts& facts, Findings& out) {
  constexpr std::string_view kPrefix = "SUBWORLD_";
  for (const auto& [name, value] : facts.machine.environment) {
    if (!name.starts_with(kPrefix)) continue;
    const std::string word = name.substr(kPrefix.size());
    if (std::ranges::find(kVariables, word) != kVariables.end()) continue;
    const std::string_view near = nearest(word, {kVariables.begin(), kVariables.end()});
    out.push_back({.what = fmt::format("the environment variable {} is none of Subworld's{}", name,
                                       near.empty() ? "" : fmt::format("; {}{} is", kPrefix, near)),
                   .why = "it has no effect, and the default holds",
                   .cure = near.empty() ? fmt::format("unset {}", name)
                                        : fmt::format("unset {}; export {}{}='{}'", name, kPrefix, near, value)});
  }
}

void judge_core_variables(const Facts& facts, Findings& out) {
  for (const auto& [name, value] : facts.machine.environment) {
    if (!name.starts_with("SUBWORLD_") || !name.ends_with("_CORE")) continue;
    if (std::atoi(value.c_str()) < facts.machine.cores) continue;
    out.push_back(
        {.what = fmt::format("{}={}: this machine has the cores 0 to {}", name, value, facts.machine.cores - 1),
         .why = "the program refuses the core and ends",
         .cure = fmt::format("unset {}", name)});
  }
}

struct VendorVariable {
  std::string_view name;
  std::string_view vendor;
};
constexpr std::array kVendorVariables{VendorVariable{"CYCLONEDDS_URI", "cyclonedds"},
                                      VendorVariable{"FASTRTPS_DEFAULT_PROFILES_FILE", "fastdds"}};

/// `--qos` wins over the variable.
void judge_vendor_variables(const Facts& facts, Findings& out) {
  if (!facts.request.network.qos_file.empty()) return;
  for (const VendorVariable& one : kVendorVariables) {
    const std::string* value = value_of_variable(facts, one.name);
    const bool used = facts.request.dds == one.vendor || facts.request.dds == "mixed";
    if (value == nullptr || value->empty() || !used) continue;
    out.push_back({.what = fmt::format("{}={} takes the place of Subworld's settings of the vendor", one.name, *value),
                   .why = "interface, peers, buffers and discovery may be those of another system, and differ between "
                          "shells and hosts",
                   .cure = fmt::format("unset {}", one.name)});
  }
}

constexpr std::array kInstallationChecks{
    Check{"programs", "world_sim, haptic_sim and device_sim lie beside `subworld`, and are of its version",
          judge_programs},
    Check{"vendor_plugin", "the library of the DDS vendor can be loaded", judge_vendors},
    Check{"engines", "the engines of the scene can be loaded", judge_engines},
    Check{"variable_names", "each variable `SUBWORLD_...` is one of Subworld's", judge_variable_names},
    Check{"core_variables", "the cores of `SUBWORLD_..._CORE` exist", judge_core_variables},
    Check{"vendor_variables", "no variable of the DDS vendor replaces Subworld's settings", judge_vendor_variables}};

}  // namespace

std::span<const Check> installation_checks() { return kInstallationChecks; }

}  // namespace subworld::doctor
