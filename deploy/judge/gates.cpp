#include "judge/gates.hpp"

#include "coupling/plan.hpp"
#include "coupling/safety/oscillation.hpp"
#include "coupling/schemes/scheme.hpp"
#include "io/results/json.hpp"
#include "judge/causes.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace subworld {

std::string grouped(std::uint64_t count) {
  std::string digits = std::to_string(count);
  for (std::size_t at = digits.size(); at > 3; at -= 3) digits.insert(at - 3, 1, ',');
  return digits;
}

namespace {

constexpr Unit kCount{"", 1.0, "1"}, kOfSteps{"% of steps", 100.0, "ratio"}, kOfReports{"% of reports", 100.0, "ratio"},
    kMilliseconds{"ms", 1e3, "s"}, kJoule{"J", 1.0, "J"}, kMetre{"m", 1.0, "m"}, kNewtonRms{"N RMS", 1.0, "N RMS"};

constexpr double kMissedRatio = 0.001;
constexpr double kRefusedRatio = 0.01;
constexpr double kLateReportsRatio = 0.05;
constexpr double kLatenessP99_s = 0.25e-3;
constexpr double kAtLimitRatio = 0.01;
/// Least energy that counts, J: a device of 0.1 kg at 0.3 m/s, or a coupling of 1000 N/m that is stretched by 3 mm.
constexpr double kLeastEnergy_j = 0.005;
constexpr double kUnexplainedRatio = 0.01;  ///< of the energy that users put in
constexpr double kOscillationRatio = 0.05;  ///< of the device's force limit

std::vector<UserOfRun> users_of(const RunResults& run) {
  std::vector<UserOfRun> users;
  for (std::size_t at = 0; at < run.haptic.size(); ++at) users.push_back({run, at});
  return users;
}

/// Of a gate. The worst one stands for it.
using Readings = std::vector<Gate>;

double work_j(const HapticResult& haptic) { return std::abs(haptic.device_work_j); }

double all_work_j(const RunResults& run) {
  double all_j = 0.0;
  for (const HapticResult& haptic : run.haptic) all_j += work_j(haptic);
  return all_j;
}

/// Energy that operators who did so much work may be given without having put it in: that of bodies.
double most_created_j(const RunResults& run, double work_j) {
  return run.world.released_j + std::max(kLeastEnergy_j, kUnexplainedRatio * work_j);
}

/// Energy that the bodies may gain beyond the operators' work and their own fall: what engines gain and lose in
/// contacts.
double most_gained_j(const RunResults& run) {
  constexpr double kOfTheWork = 0.25, kOfTheFall = 0.05;
  return run.world.contact_slack_j + std::max(kLeastEnergy_j, kOfTheWork * all_work_j(run)) +
         kOfTheFall * run.world.released_j;
}

Gate reading(std::string name, Unit unit, auto value, double bound, Cause cause) {
  return {std::move(name), unit, static_cast<double>(value), bound, std::move(cause)};
}

/// Samples of programs that do not belong to the run.
Readings foreign_writers(const RunResults& run) {
  Readings all;
  const auto add = [&](const std::string& user, const char* topic, const char* program, std::uint64_t refused,
                       const std::string& by) {
    all.push_back(reading(user + topic + " from a foreign writer", kCount, refused, 0.0,
                          {Culprit::foreign_writer,
                           fmt::format("another program{} published them as {}, and they were refused; end it, or give "
                                       "it another --domain",
                                       by.empty() ? "" : " (" + by + ")", program)}));
  };
  const WorldRefused& world = run.world.refused;
  add("", "scene", "world_sim", world.scene, world.by);
  add("", "haptic_report", "haptic_sim", world.haptic_report, world.by);
  for (const UserOfRun& at : users_of(run)) {
    const HapticRefused& haptic = at.haptic().refused;
    add(at.name(), "world_frame", "world_sim", haptic.world_frame, haptic.by);
    add(at.name(), "device_state", "device_sim", haptic.device_state, haptic.by);
    add(at.name(), "device_command", "haptic_sim", at.device().refused.device_command, at.device().refused.by);
    all.push_back(reading(at.name() + "device_command that haptic_sim did not send", kCount,
                          at.device().refused.forged_command, 0.0,
                          {Culprit::foreign_writer,
                           "another program sent packets in its name, and they were dropped; find it, or separate this "
                           "network: DDS does not authenticate programs"}));
  }
  return all;
}

Readings bodies_energy(const RunResults& run) {
  const bool absent =
      std::ranges::any_of(run.device, [](const DeviceResult& one) { return one.driver && one.driver->absences > 0; });
  const bool of_scheme = scheme_of(run.scene.settings).properties.creates_energy_late;
  const bool of_network = run.has_unknown_delay() && std::ranges::any_of(run.haptic, [](const auto& one) {
                            return one.late_reports_ratio > kLateReportsRatio || one.lost_frames > 0;
                          });
  constexpr double kSlowed = 0.9;
  const bool of_clock = run.realtime() && run.world.real_time_factor_min < kSlowed;
  const std::string cure =
      of_scheme    ? ": with late messages this --scheme creates it; another one, or less delay"
      : of_network ? fmt::format(
                         "; messages were late or lost on the way{}, which can create it; compare with a run "
                         "without that delay",
                         link_text(run))
      : of_clock ? "; the world was too slow, so its clock changed its rate, which the sub-worlds learn late: fewer "
                   "bodies or users, a larger --ratio, or more cores"
                 : "; a smaller --ratio, --set world.preset=quality, or another --engine";
  const Cause cause = absent ? Cause{Culprit::run,
                                     "a device was absent, and what its operator did meanwhile is in no account; find "
                                     "out why its readings stopped"}
                             : Cause{Culprit::unstable, "the operators did not put it in" + cure};
  return {reading("energy that the bodies gained", kJoule, run.energy_excess_j, most_gained_j(run), cause)};
}

/// Messages between world and sub-worlds that were lost, late or refused.
Readings messages(const RunResults& run) {
  const double reports = static_cast<double>(run.world.cycles) * static_cast<double>(run.haptic.size());
  const double refused = static_cast<double>(run.world.refused_reports) / std::max(1.0, reports);
  Readings all{reading("reports that the world refused", kOfReports, refused, kRefusedRatio,
                       {Culprit::run,
                        "the world did not get these users' pushes: reports came more than 16 cycles late, between "
                        "hosts more than 0.5 s; look for a slow network, or for a sub-world that was halted"})};
  for (const UserOfRun& at : users_of(run)) {
    all.push_back(reading(at.name() + "lost frames", kCount, at.haptic().lost_frames, 0.0, by_loss(at)));
    if (run.has_unknown_delay())
      all.push_back(reading(at.name() + "late reports", kOfReports, at.haptic().late_reports_ratio, kLateReportsRatio,
                            {Culprit::network,
                             "reports reached the world after it needed them, so it guessed what the operator did: the "
                             "force may be off"}));
  }
  return all;
}

/// Energy that no operator has put in, at each and at all together.
Readings operators_energy(const RunResults& run) {
  Readings all;
  for (const UserOfRun& at : users_of(run)) {
    all.push_back(reading(at.name() + "created energy at the operator", kJoule, at.device().operator_energy.created_j,
                          most_created_j(run, work_j(at.haptic())),
                          {Culprit::unstable, "neither the operator nor the bodies had it; " + coupling_cure(at)}));
  }
  if (run.haptic.size() > 1)
    all.push_back(
        reading("created energy at all operators together", kJoule, run.world.operators_created_j,
                most_created_j(run, all_work_j(run)),
                {Culprit::unstable, "neither an operator nor the bodies had it; less delay, or a smaller --ratio"}));
  return all;
}

Readings recording(const RunResults& run) {
  if (!run.recording) return {};
  const std::string& fault = run.recording->fault;
  return {reading("messages that the recording lost", kCount, run.recording->lost(), 0.0,
                  {Culprit::run, !fault.empty() ? fault
                                                : "the recorder's memory was full; --record needs a faster disk, or an "
                                                  "idle core"})};
}

/// An admittance device that its proxy leaves behind: the coupling no longer holds the proxy.
Readings distance(const UserOfRun& at) {
  constexpr double kFree_m = 0.1, kRounds = 2.0;
  if (at.spec().kind != DeviceKind::admittance) return {};
  const DelaySettings& d = at.settings().delay;
  const double late_s =
      at.settings().longest_cycle_s() + d.up_s + d.down_s + d.from_device_s + d.to_device_s + d.jitter_s;
  return {reading("distance between proxy and device", kMetre, at.haptic().proxy_apart_max_m,
                  kFree_m + kRounds * late_s * at.spec().speed_limit_m_s,
                  {Culprit::unstable, fmt::format("the proxy ran away from its device, which moves at most at {:g} "
                                                  "m/s; {}",
                                                  at.spec().speed_limit_m_s, coupling_cure(at))})};
}

Readings jumps(const UserOfRun& at) {
  return {reading("device faster than an operator moves", kOfSteps, at.of_steps(at.haptic().device_jumps), 0.0,
                  {Culprit::run,
                   "the force was off in these steps, and ramped afterwards: no operator moves a device at more than "
                   "10 m/s; slow the path of the scene, or examine the device's sensors"})};
}

/// The cause of steps that the OS misses.
Cause by_os(const UserOfRun& at) {
  const HapticResult& haptic = at.haptic();
  return by_late_wake_ups("loop", haptic.machine, haptic.woken_late_s.p50, haptic.missed_by_os, at.periods(),
                          static_cast<double>(haptic.missed_by_os) * at.settings().h_s, at.run.haptic.size() > 1,
                          at.run);
}

Readings oscillation(const UserOfRun& at) {
  constexpr double kOftenRatio = 0.1;  // of the steps: a coupling is stable at its rate only
  const HapticResult& haptic = at.haptic();
  const bool often =
      at.run.realtime() && at.of_steps(haptic.missed_by_os) > kOftenRatio && haptic.missed_by_os > haptic.missed_by_run;
  constexpr double kLeast_s = OscillationWatch::kBlock_s * (1.0 + OscillationWatch::kLasting);
  std::string name = "oscillation of the force";
  if (at.run.simulated_s < kLeast_s)
    name += fmt::format(" (a run of less than {:g} s is too short to detect it)", kLeast_s);
  const Cause coupling{Culprit::unstable,
                       "the force oscillates faster than an operator moves; a lower coupling stiffness_n_m or "
                       "damping_n_s_m, a smaller --ratio or h_s, or the scheme reduced"};
  return {reading(name, kNewtonRms, at.device().oscillation_n, kOscillationRatio * at.spec().force_limit_n,
                  often ? by_os(at) : coupling)};
}

/// Steps that miss their deadline, or start late: woken late, or after a step that ended late.
Readings loop(const UserOfRun& at) {
  if (!at.run.realtime()) return {};
  const HapticResult& haptic = at.haptic();
  const Cause own = by_own_steps(at);
  const Cause os = by_os(at);
  const bool woken_late = haptic.woken_late_s.p99 > kLatenessP99_s || haptic.missed_by_os > haptic.missed_by_run;
  return {reading("missed by the run", kOfSteps, at.of_steps(haptic.missed_by_run), kMissedRatio, own),
          reading("lateness p99", kMilliseconds, haptic.lateness_s.p99, kLatenessP99_s, woken_late ? os : own),
          reading(kMissedByTheOs, kOfSteps, at.of_steps(haptic.missed_by_os), kMissedRatio, os)};
}

Readings limit(const UserOfRun& at) {
  return {reading("at the device's limit", kOfSteps, at.haptic().at_limit_ratio, kAtLimitRatio,
                  {Culprit::scene,
                   "the operator feels the limit, not the scene; move the device less far into bodies, lower the "
                   "coupling's stiffness, or raise the device's force_limit_n"})};
}

Readings world_clock(const RunResults& run) {
  if (!run.realtime()) return {};
  Gate factor = reading("world real-time factor", kCount, run.world.real_time_factor_min, 1.0, by_slow_cycles(run));
  factor.at_most = false;
  return {factor};
}

/// A row is a gate. Its readings are empty where it does not hold.
constexpr std::array kGatesOfRun{foreign_writers, bodies_energy, messages, operators_energy, recording};
constexpr std::array kGatesOfUser{distance, jumps, oscillation, loop, limit};

/// Adds the worst reading, which stands for its gate. It names the others that are missed.
void judge(const Readings& readings, const std::string& user, std::vector<Gate>& all) {
  const auto fault = [](const Gate& one) { return one.ok() ? 0 : one.spoils_verdict() ? 2 : 1; };
  const auto worst = std::ranges::max_element(readings, {}, fault);
  if (worst == readings.end()) return;
  Gate& gate = all.emplace_back(*worst);
  gate.name = user + gate.name;
  for (const Gate& one : readings)
    if (&one != &*worst && !one.ok()) gate.cause.why += "; also " + user + one.figure();
}

/// "0.31 ms"
std::string with_unit(double value, const Unit& unit) {
  return fmt::format("{:.4g}{}{}", unit.scale * value, *unit.text ? " " : "", unit.text);
}

}  // namespace

std::string Gate::figure() const { return fmt::format("{} {}", name, with_unit(value, unit)); }

std::string Gate::line() const {
  const std::string held = fmt::format("{} {} {}", figure(), at_most ? "<=" : ">=", with_unit(bound, unit));
  if (ok()) return held + ": ok";
  return fmt::format("{}: {}{}{}", held,
                     spoils_verdict() ? "MISSED"
                     : is_remark()    ? "remark"
                                      : "warning",
                     cause.why.empty() ? "" : ": ", cause.why);
}

void to_json(Json& json, const Gate& gate) {
  constexpr std::array kCulprits{"run",    "os", "scene", "unstable", "foreign_writer",
                                 "network"};  // in the order of Culprit
  json = {{"name", gate.name},
          {"value", gate.value},
          {"bound", gate.bound},
          {"at_most", gate.at_most},
          {"unit", gate.unit.si},
          {"ok", gate.ok()},
          {"warning", !gate.ok() && !gate.spoils_verdict()}};
  if (!gate.ok()) {
    json["missed_by"] = kCulprits[static_cast<std::size_t>(gate.cause.culprit)];
    json["why"] = gate.cause.why;
  }
}

std::vector<Gate> gates(const RunResults& run) {
  std::vector<Gate> all;
  for (const auto measure : kGatesOfRun) judge(measure(run), "", all);
  for (const UserOfRun& at : users_of(run)) {
    for (const auto measure : kGatesOfUser) judge(measure(at), at.name(), all);
  }
  judge(world_clock(run), "", all);
  return all;
}

std::vector<std::string> missed_strictly(const std::vector<Gate>& gates) {
  std::vector<std::string> names;
  for (const Gate& gate : gates) {
    if (gate.counts_strictly()) names.push_back(gate.name);
  }
  return names;
}

}  // namespace subworld
