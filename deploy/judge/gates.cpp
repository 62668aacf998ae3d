#include "judge/gates.hpp"

#include "coupling/plan.hpp"
#include "coupling/safety/oscillation.hpp"
#include "coupling/schemes/scheme.hpp"
#include "io/json.hpp"
#include "judge/summary.hpp"
#include "wire/topics.hpp"

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

std::string load_text(const RunResults& run) {
  if (!run.load) return {};
  return fmt::format("of {} cores the run used {:.2f}, other programs {:.2f}, the hypervisor {:.2f}", run.cores,
                     run.load->own, run.load->other, run.load->stolen);
}

std::string calibration_text(const RunResults& run) {
  if (!run.calibration) return {};
  return fmt::format("bare loops on this machine: {} of {} wake-ups late", grouped(run.calibration->late),
                     grouped(run.calibration->wake_ups));
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

constexpr double kLongStep = 0.5;    ///< part of the cycle: a p99 below it slows no clock
constexpr double kFullCores = 0.8;   ///< part of the cores; above it the programs of the run delay each other
constexpr double kQuietCores = 0.1;  ///< cores that other programs and the hypervisor use on a quiet machine

/// What a gate looks at: the run, and one of its users.
struct View {
  const RunResults& run;
  std::size_t at = 0;  ///< of its results: one who took no part has none
  std::size_t user = run.haptic[at].user;

  [[nodiscard]] const Settings& settings() const { return run.scene.settings; }
  [[nodiscard]] const HapticResult& haptic() const { return run.haptic[at]; }
  [[nodiscard]] const DeviceResult& device() const { return run.device[at]; }
  [[nodiscard]] const DeviceSpec& spec() const { return run.scene.users[user].device; }
  /// Of the haptic loop, with the skipped ones.
  [[nodiscard]] double periods() const {
    return std::max(1.0, static_cast<double>(haptic().steps + haptic().skipped_steps));
  }
};

/// Late part of the wake-ups of bare loops before the run; 0: not measured.
double late_bare_ratio(const RunResults& run) {
  if (!run.calibration) return 0.0;
  return static_cast<double>(run.calibration->late) / std::max(1.0, static_cast<double>(run.calibration->wake_ups));
}

/// " (a; b)" of those that are not empty.
std::string in_brackets(const std::string& a, const std::string& b) {
  if (a.empty() && b.empty()) return {};
  return fmt::format(" ({}{}{})", a, a.empty() || b.empty() ? "" : "; ", b);
}

/// Whether other loops of the run, more than the OS, delayed this loop in `delayed` of its `steps`, by `lost_s` in all.
/// All of this must hold:
///  * nothing else uses the machine, as far as that was measured;
///  * a bare loop was late less often;
///  * the loop waited longer for a core than it lost, typical wake-ups not counted;
///  * a program of the run could take that core: a rival of at least the loop's priority, or, for a loop without
///    real-time priority on cores that the run fills, any.
template <class Loop>
bool delayed_by_the_run(const Loop& loop, double delayed, double steps, double lost_s, bool has_rivals,
                        const RunResults& run) {
  const bool quiet = !run.load || run.load->other + run.load->stolen < kQuietCores;
  if (!quiet || delayed <= late_bare_ratio(run) * steps) return false;
  const double queued_s = loop.machine.run_queue_delay_s - steps * loop.woken_late_s.p50;
  const bool full = run.load && run.load->own > kFullCores * run.cores;
  return queued_s > lost_s && (has_rivals || (full && !loop.machine.fifo));
}

/// Why a loop's own steps miss deadlines.
Cause by_own_steps(const View& at) {
  const HapticResult& haptic = at.haptic();
  if (static_cast<double>(haptic.missed_waiting) > 0.5 * static_cast<double>(haptic.missed_by_run)) {
    return {Culprit::run,
            "steps slept or waited for a lock, most likely in the middleware; look for a slow network, or try the "
            "other --dds"};
  }
  return {Culprit::run, fmt::format("steps take {:.2f} ms (p99 {:.2f} ms) of {:g} ms; a lower budget_ratio or a "
                                    "smaller box_half_m, a faster preset or engine, or a longer h_s",
                                    1e3 * haptic.step_s.p50, 1e3 * haptic.step_s.p99, 1e3 * at.settings().h_s)};
}

const char* quiet_cure(const MachineShare& machine) {
  return machine.fifo ? "run again when the machine is quiet"
                      : "run with real-time rights, or again when the machine is quiet";
}

Cause by_late_wake_ups(const View& at) {
  const HapticResult& haptic = at.haptic();
  const auto missed = static_cast<double>(haptic.missed_by_os);
  if (delayed_by_the_run(haptic, missed, at.periods(), missed * at.settings().h_s, at.run.haptic.size() > 1, at.run)) {
    return {
        Culprit::run,
        fmt::format(
            "the programs of the run compete for the cores{}; fewer users or members, more cores, a higher ratio, or a "
            "longer h_s",
            in_brackets(
                fmt::format("this loop was ready for {:.0f} ms without one", 1e3 * haptic.machine.run_queue_delay_s),
                load_text(at.run)))};
  }
  return {Culprit::os,
          fmt::format("the OS woke the loop late or pre-empted it{}; {}",
                      in_brackets(calibration_text(at.run), load_text(at.run)), quiet_cure(haptic.machine))};
}

/// A step that starts late was woken late, or the step before it ended late.
Cause by_late_starts(const View& at) {
  const HapticResult& haptic = at.haptic();
  const bool os = haptic.woken_late_s.p99 > kLatenessP99_s || haptic.missed_by_os > haptic.missed_by_run;
  return os ? by_late_wake_ups(at) : by_own_steps(at);
}

Cause by_slow_cycles(const RunResults& run) {
  const WorldResult& world = run.world;
  const auto by_os = static_cast<double>(world.late_by_os), cycles = static_cast<double>(world.cycles);
  const double cycle_s = run.scene.settings.h_s * world.ratio.mean();
  const bool has_own_core = !run.placement.world.empty();
  const bool steps_are_long = world.step_s.p99 > kLongStep * cycle_s;
  if (world.late_by_run > world.late_by_os || (steps_are_long && world.late_by_os == 0)) {
    if (steps_are_long) {
      return {Culprit::run, fmt::format("the world's step takes {:.2f} ms (p99 {:.2f} ms) of cycles of {:.3g} ms; a "
                                        "higher ratio, fewer bodies, or a faster preset or engine",
                                        1e3 * world.step_s.p50, 1e3 * world.step_s.p99, 1e3 * cycle_s)};
    }
    return {Culprit::run,
            fmt::format("{} of {} cycles were too long, the longest {:.2f} ms of {:.3g} ms; the others fit (p99 {:.2f} "
                        "ms); --trace FILE shows what they did",
                        grouped(world.late_by_run), grouped(world.cycles), 1e3 * world.step_s.max, 1e3 * cycle_s,
                        1e3 * world.step_s.p99)};
  }
  if (delayed_by_the_run(world, by_os, cycles, by_os * cycle_s, !has_own_core, run)) {
    return {Culprit::run,
            fmt::format("the programs of the run compete for the cores{}; fewer users or members, more cores, or a "
                        "higher ratio",
                        in_brackets(fmt::format("the world was ready for {:.0f} ms without one",
                                                1e3 * world.machine.run_queue_delay_s),
                                    load_text(run)))};
  }
  if (world.late_by_os == 0) return {Culprit::os, ""};  // no cycle was late: nothing to cure
  return {Culprit::os, fmt::format("the OS woke the world late or pre-empted it in {:.0f} of {} cycles{}; {}", by_os,
                                   grouped(world.cycles), in_brackets(load_text(run), {}), quiet_cure(world.machine))};
}

/// Why frames of the world did not reach a sub-world. In real time its reader holds a few frames, so one that was
/// halted for longer loses the others.
Cause by_loss(const View& at) {
  const double halted_s = static_cast<double>(at.haptic().skipped_steps) * at.settings().h_s;
  const double history_s = static_cast<double>(kTopicOf<WorldFrame>.depth) * at.settings().h_s * at.settings().ratio;
  if (at.run.between_hosts && halted_s < history_s)
    return {Culprit::network,
            "frames of the world were lost on the network; look for loss and delay with `subworld lab network`"};
  return {Culprit::run,
          "frames of the world were lost on the way; the sub-world was halted, or the network is too slow"};
}

/// What makes the coupling of a user stable again.
std::string coupling_cure(const View& at) {
  return fmt::format("{}, less delay or a smaller --ratio{}",
                     at.spec().kind == DeviceKind::admittance ? "a heavier proxy" : "a lower coupling stiffness_n_m",
                     enabled(at.run.scene, Optimisation::energy_bound, at.user) ? ", or --passivity on" : "");
}

/// An admittance device that its proxy leaves behind: the coupling no longer holds the proxy.
double farthest_proxy_m(const View& at) {
  constexpr double kFree_m = 0.1, kRounds = 2.0;
  const DelaySettings& d = at.settings().delay;
  const double late_s =
      at.settings().longest_cycle_s() + d.up_s + d.down_s + d.from_device_s + d.to_device_s + d.jitter_s;
  return kFree_m + kRounds * late_s * at.spec().speed_limit_m_s;
}

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

std::string oscillation_name(const RunResults& run) {
  constexpr double kLeast_s = OscillationWatch::kBlock_s * (1.0 + OscillationWatch::kLasting);
  if (run.simulated_s >= kLeast_s) return "oscillation of the force";
  return fmt::format("oscillation of the force (a run of less than {:g} s is too short to detect it)", kLeast_s);
}

/// A count of samples of programs that do not belong to the run.
Gate foreign_writer_gate(const char* topic, const char* program, std::uint64_t refused, const std::string& by) {
  return {fmt::format("{} from a foreign writer", topic),
          kCount,
          static_cast<double>(refused),
          0.0,
          {Culprit::foreign_writer,
           fmt::format("{} published them as {}, and they were refused; end it, or give it another --domain",
                       by.empty() ? "another program" : fmt::format("another program ({})", by), program)}};
}

/// Gates of a user, some of which hold only for some devices or modes.
struct Row {
  bool holds;
  Gate gate;
};
/// Whether the force is the scene's.
std::vector<Row> force_rows(const View& at) {
  const HapticResult& haptic = at.haptic();
  const DeviceResult& device = at.device();
  const DeviceSpec& spec = at.spec();
  const bool admittance = spec.kind == DeviceKind::admittance;
  return {{true, foreign_writer_gate("world_frame", "world_sim", haptic.refused.world_frame, haptic.refused.by)},
          {true, foreign_writer_gate("device_state", "device_sim", haptic.refused.device_state, haptic.refused.by)},
          {true, foreign_writer_gate("device_command", "haptic_sim", device.refused.device_command, device.refused.by)},
          {admittance,
           {"distance between proxy and device",
            kMetre,
            haptic.proxy_apart_max_m,
            farthest_proxy_m(at),
            {Culprit::unstable, fmt::format("the proxy ran away from its device, which moves at most at {:g} m/s; {}",
                                            spec.speed_limit_m_s, coupling_cure(at))}}},
          {true,
           {"device faster than an operator moves",
            kOfSteps,
            static_cast<double>(haptic.device_jumps) / at.periods(),
            0.0,
            {Culprit::run,
             "the force was off in these steps, and ramped afterwards: no operator moves a device at more than 10 m/s; "
             "slow the path of the scene, or examine the device's sensors"}}},
          {true,
           {"created energy at the operator",
            kJoule,
            device.operator_energy.created_j,
            most_created_j(at.run, work_j(haptic)),
            {Culprit::unstable, "neither the operator nor the bodies had it; " + coupling_cure(at)}}},
          {true,
           {oscillation_name(at.run),
            kNewtonRms,
            device.oscillation_n,
            kOscillationRatio * spec.force_limit_n,
            {Culprit::unstable,
             "the force oscillates faster than an operator moves; a lower coupling stiffness_n_m or damping_n_s_m, a "
             "smaller --ratio or h_s, or the scheme reduced"}}},
          {true,
           {"at the device's limit",
            kOfSteps,
            haptic.at_limit_ratio,
            kAtLimitRatio,
            {Culprit::scene,
             "the operator feels the limit, not the scene; move the device less far into bodies, lower the coupling's "
             "stiffness, or raise the device's force_limit_n"}}}};
}

/// Whether forces and messages were in time.
std::vector<Row> timing_rows(const View& at) {
  const HapticResult& haptic = at.haptic();
  const bool realtime = at.run.realtime();
  return {{realtime,
           {"missed by the run", kOfSteps, static_cast<double>(haptic.missed_by_run) / at.periods(), kMissedRatio,
            by_own_steps(at)}},
          {realtime,
           {kMissedByTheOs, kOfSteps, static_cast<double>(haptic.missed_by_os) / at.periods(), kMissedRatio,
            by_late_wake_ups(at)}},
          {realtime, {"lateness p99", kMilliseconds, haptic.lateness_s.p99, kLatenessP99_s, by_late_starts(at)}},
          {true, {"lost frames", kCount, static_cast<double>(haptic.lost_frames), 0.0, by_loss(at)}},
          {realtime && at.run.between_hosts,
           {"late reports",
            kOfReports,
            haptic.late_reports_ratio,
            kLateReportsRatio,
            {Culprit::network,
             "reports reached the world after it needed them, so it guessed what the operator did: the force may be "
             "off"}}}};
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
  const WorldResult& world = run.world;
  std::vector<Gate> all{
      foreign_writer_gate("scene", "world_sim", world.refused.scene, world.refused.by),
      foreign_writer_gate("haptic_report", "haptic_sim", world.refused.haptic_report, world.refused.by),
      {"energy that the bodies gained",
       kJoule,
       run.energy_excess_j,
       most_gained_j(run),
       {Culprit::unstable,
        scheme_of(run.scene.settings).properties.creates_energy_late
            ? "the operators did not put it in: with late messages this --scheme creates it; another one, or less delay"
            : "the operators did not put it in; a smaller --ratio, --set world.preset=quality, or another --engine"}}};
  const double reports =
      static_cast<double>(world.cycles) * static_cast<double>(std::max<std::size_t>(1, run.haptic.size()));
  all.push_back(
      {"reports that the world refused",
       kOfReports,
       static_cast<double>(world.refused_reports) / std::max(1.0, reports),
       kRefusedRatio,
       {Culprit::run,
        "the world did not get these users' pushes: reports came more than 16 cycles late, between hosts more "
        "than 0.5 s; look for a slow network, or for a sub-world that was halted"}});
  if (run.haptic.size() > 1) {
    all.push_back({"created energy at all operators together",
                   kJoule,
                   world.operators_created_j,
                   most_created_j(run, all_work_j(run)),
                   {Culprit::unstable, "neither an operator nor the bodies had it; less delay, or a smaller --ratio"}});
  }
  if (run.recording) {
    all.push_back({"messages that the recording lost",
                   kCount,
                   static_cast<double>(run.recording->lost()),
                   0.0,
                   {Culprit::run, run.recording->fault.empty()
                                      ? "the recorder's memory was full; --record needs a faster disk, or an idle core"
                                      : run.recording->fault}});
  }
  for (std::size_t u = 0; u < run.haptic.size(); ++u) {
    for (auto rows : {force_rows, timing_rows}) {
      for (Row& row : rows({run, u})) {
        row.gate.name = fmt::format("user {}: {}", run.haptic[u].user, row.gate.name);
        if (row.holds) all.push_back(std::move(row.gate));
      }
    }
  }
  if (run.realtime())
    all.push_back({"world real-time factor", kCount, world.real_time_factor_min, 1.0, by_slow_cycles(run), false});
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
