#include "doctor/checks.hpp"
#include "io/options/options.hpp"
#include "io/results/json.hpp"
#include "io/results/output.hpp"
#include "model/error.hpp"
#include "tools.hpp"
#include "wire/session.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstdio>

namespace {

using namespace subworld;
using namespace subworld::doctor;

bool has_finding(const Findings& findings, const Check& check) {
  return std::ranges::find(findings, check.name, &Finding::check) != findings.end();
}

/// Facts that are neither right nor wrong.
std::vector<std::string> remarks(const Facts& facts) {
  std::vector<std::string> lines;
  const Machine& machine = facts.machine;
  lines.push_back(fmt::format("bare loops at 1 kHz wake p99 {:.3f} ms late, at most {:.3f} ms",
                              1e3 * machine.lateness_p99_s, 1e3 * machine.lateness_max_s));
  for (const InstalledPart& part : machine.parts) lines.push_back(fmt::format("{}: {}", part.name, part.version));
  for (const Interface& one : facts.network.interfaces) {
    lines.push_back(fmt::format("interface {}: {}, {}, MTU {}", one.name,
                                one.address.empty() ? "no IPv4 address" : one.address,
                                one.running ? "running" : "not running", one.mtu));
  }
  if (!facts.domain.number)
    lines.emplace_back(
        "no run is on this machine, and no --domain is given: the checks of a domain have nothing to do");
  for (const Status& one : facts.domain.statuses)
    lines.push_back(fmt::format("domain {}: {} is {}", facts.domain.number.value_or(0),
                                label_of(one.program, one.instance), one.state));
  return lines;
}

void print_text(const Facts& facts, const Findings& findings, bool verbose) {
  const std::vector<Check> all = checks();
  if (verbose) {
    for (const std::string& line : remarks(facts)) fmt::print("{}\n", line);
    for (const Check& check : all)
      fmt::print("{} {}: {}\n", has_finding(findings, check) ? "FOUND" : "ok   ", check.name, check.about);
  }
  for (const Finding& one : findings) {
    const Finding& first = *std::ranges::find(findings, one.cure, &Finding::cure);
    fmt::print("{}: {}\n  why:  {}\n  cure: {}\n", one.check, one.what, one.why,
               &first == &one ? one.cure : fmt::format("the same command as for {}, once", first.check));
  }
  if (findings.empty()) {
    fmt::print("healthy: {} checks passed\n", all.size());
    return;
  }
  const auto passed = std::ranges::count_if(all, [&](const Check& one) { return !has_finding(findings, one); });
  fmt::print("{} finding{}; {} of {} checks passed\n", findings.size(), findings.size() == 1 ? "" : "s", passed,
             all.size());
}

void print_json(const Facts& facts, const Findings& findings) {
  Json json{{"healthy", findings.empty()}, {"checks", Json::array()}, {"findings", Json::array()}};
  for (const Check& check : checks()) json["checks"].push_back(check.name);
  for (const Finding& one : findings)
    json["findings"].push_back({{"check", one.check}, {"what", one.what}, {"why", one.why}, {"cure", one.cure}});
  json["remarks"] = remarks(facts);
  fmt::print("{}\n", json_text(json, 2));
}

int main_of(int argc, char** argv) {
  CommandLine line("subworld doctor", about_tool("doctor"));
  Request request;
  bool verbose = false, as_json = false;
  line.add("scene", &request.scene, "scene that is to run: its users and engines are examined too").otherwise("none");
  line.add("--domain", &request.domain, "DDS domain")
      .range(0, 232)
      .environment("SUBWORLD_DOMAIN")
      .otherwise("that of the run on this machine");
  add_dds(line, request.dds, {"fastdds", "cyclonedds", "mixed"});
  add_network(line, request.network);
  line.add("--qos", &request.network.qos_file, "the DDS vendor's settings file")
      .otherwise("the vendor's environment variable, else qos/VENDOR.xml beside the programs");
  line.flag("--verbose", verbose, "also list all checks, and what was measured");
  line.flag("--json", as_json, "print one JSON object: healthy, checks, findings, remarks");
  line.footer(
      "Examples:\n"
      "  subworld doctor\n"
      "  subworld doctor heap --domain 70 --verbose\n"
      "  subworld doctor --domain 70 --interface eth0 --peers 10.0.0.2\n"
      "Each finding has a cure: a command for the shell that the doctor was started from.\n"
      "Exit codes: 0 healthy, 4 something was found, 2 usage or scene.");
  if (const auto code = line.parse(argc, argv)) return *code;
  const Facts facts = read_facts(request);
  const Findings findings = judge(facts);
  if (as_json) {
    print_json(facts, findings);
  } else {
    print_text(facts, findings, verbose);
  }
  std::fflush(stdout);
  return static_cast<int>(findings.empty() ? ExitCode::done : ExitCode::quality);
}

}  // namespace

int main(int argc, char** argv) {
  return subworld::finished("subworld doctor",
                            subworld::guarded("subworld doctor", [&] { return main_of(argc, argv); }));
}
