#include "gates.hpp"

#include "coupling/oscillation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace subworld {

double milliseconds(const Json& seconds) { return 1e3 * seconds.get<double>(); }

std::string grouped(std::uint64_t count) {
  std::string digits = std::to_string(count);
  for (std::size_t at = digits.size(); at > 3; at -= 3) digits.insert(at - 3, 1, ',');
  return digits;
}

std::string load_text(const Json& summary) {
  const Json& load = summary["machine_load"];
  return fmt::format("of {} cores the run used {:.2f}, other programs {:.2f}, the hypervisor {:.2f}",
                     summary["machine"]["cores"].get<int>(), load["own_cores"].get<double>(),
                     load["other_cores"].get<double>(), load["stolen_cores"].get<double>());
}

std::string calibration_text(const Json& summary) {
  if (!summary.contains("calibration")) return {};
  const Json& calibration = summary["calibration"];
  return fmt::format("bare loops on this machine: {} of {} wake-ups late",
                     grouped(calibration["late"].get<std::uint64_t>()),
                     grouped(calibration["wake_ups"].get<std::uint64_t>()));
}

namespace {

constexpr double kMissedRatio = 0.001;
constexpr double kLatenessP99_s = 0.25e-3;
constexpr double kAtLimitRatio = 0.01;
/// Least energy that counts, J: a device of 0.1 kg at 0.3 m/s, or a coupling of 1000 N/m that is stretched by 3 mm.
constexpr double kLeastEnergy_j = 0.005;
constexpr double kUnexplainedRatio = 0.01;  ///< of the energy that users put in
constexpr double kOscillationRatio = 0.05;  ///< of the device's force limit

constexpr double kFullCores = 0.8;   ///< part of the cores; above it the programs of the run delay each other
constexpr double kQuietCores = 0.1;  ///< cores that other programs and the hypervisor use on a quiet machine

/// Late part of the wake-ups of bare loops before the run; 0: not measured.
double late_bare_ratio(const Json& summary) {
  if (!summary.contains("calibration")) return 0.0;
  const Json& calibration = summary["calibration"];
  return calibration["late"].get<double>() / std::max(1.0, calibration["wake_ups"].get<double>());
}

/// Whether other loops of the run, more than the OS, delayed this loop in `delayed` of its `steps`, by `lost_s` in all.
/// All of this must hold:
///  * nothing else uses the machine;
///  * a bare loop was late less often;
///  * the loop waited longer for a core than it lost, typical wake-ups not counted;
///  * a program of the run could take that core: a rival of at least the loop's priority, or, for a loop without
///    real-time priority on cores that the run fills, any.
bool delayed_by_the_run(const Json& loop, double delayed, double steps, double lost_s, bool has_rivals,
                        const Json& summary) {
  const Json& load = summary["machine_load"];
  const bool quiet = load["other_cores"].get<double>() + load["stolen_cores"].get<double>() < kQuietCores;
  if (!quiet || delayed <= late_bare_ratio(summary) * steps) return false;
  const double queued_s =
      loop["machine"]["run_queue_delay_s"].get<double>() - steps * loop["woken_late_s"]["p50"].get<double>();
  const bool full = load["own_cores"] > kFullCores * summary["machine"]["cores"].get<double>();
  return queued_s > lost_s && (has_rivals || (full && !loop["machine"]["fifo"].get<bool>()));
}

/// Why a loop's own steps miss deadlines.
std::string why_the_run_missed(const Json& haptic, double h_s) {
  const double by_run = haptic["missed_by_run"].get<double>();
  if (haptic["missed_waiting"].get<double>() > 0.5 * by_run) {
    return "steps slept or waited for a lock, most likely in the middleware; look for a slow network, or try the other "
           "--dds";
  }
  return fmt::format(
      "steps take {:.2f} ms (p99 {:.2f} ms) of {:g} ms; a lower budget_ratio or a smaller box_half_m, a faster preset "
      "or engine, or a longer h_s",
      milliseconds(haptic["step_s"]["p50"]), milliseconds(haptic["step_s"]["p99"]), 1e3 * h_s);
}

const char* quiet_cure(const Json& loop) {
  return loop["machine"]["fifo"].get<bool>() ? "run again when the machine is quiet"
                                             : "run with real-time rights, or again when the machine is quiet";
}

Gate os_gate(const std::string& who, const Json& haptic, double periods, const Json& summary) {
  const double missed = haptic["missed_by_os"].get<double>();
  Gate gate{who + "missed by the OS", missed / periods, kMissedRatio, true, "% of steps", 100.0};
  if (delayed_by_the_run(haptic, missed, periods, missed * summary["h_s"].get<double>(), summary["users"] > 1,
                         summary)) {
    gate.why = fmt::format(
        "the programs of the run compete for the cores (this loop was ready for {:.0f} ms without one; {}); fewer "
        "users or members, more cores, a higher ratio, or a longer h_s",
        milliseconds(haptic["machine"]["run_queue_delay_s"]), load_text(summary));
  } else {
    gate.culprit = Culprit::os;
    gate.why = fmt::format("the OS woke the loop late or pre-empted it ({}; {}); {}", calibration_text(summary),
                           load_text(summary), quiet_cure(haptic));
  }
  return gate;
}

/// A step that starts late was woken late, or the step before it ended late.
Gate lateness_gate(const std::string& who, const Json& haptic, const Gate& by_os, const std::string& why_run) {
  const bool woken_late = haptic["woken_late_s"]["p99"].get<double>() > kLatenessP99_s;
  const bool os = woken_late || haptic["missed_by_os"] > haptic["missed_by_run"];
  return {who + "lateness p99",
          haptic["lateness_s"]["p99"].get<double>(),
          kLatenessP99_s,
          true,
          "ms",
          1e3,
          os ? by_os.culprit : Culprit::run,
          os ? by_os.why : why_run};
}

Gate clock_gate(const Json& summary) {
  const Json& world = summary["world"];
  const double by_run = world["late_by_run"].get<double>(), by_os = world["late_by_os"].get<double>();
  const bool has_own_core = !summary["placement"]["world"].empty();
  const double cycle_s = summary["h_s"].get<double>() * world["ratio"]["mean"].get<double>();
  const bool by_the_run = by_run > by_os || delayed_by_the_run(world, by_os, world["cycles"].get<double>(),
                                                               by_os * cycle_s, !has_own_core, summary);
  Gate gate{"world real-time factor", world["real_time_factor_min"].get<double>(), 1.0, false};
  if (by_the_run) {
    gate.why = fmt::format(
        "the world's step takes {:.2f} ms (p99 {:.2f} ms) of cycles of {:.3g} ms; a higher ratio, fewer bodies, or a "
        "faster preset or engine",
        milliseconds(world["step_s"]["p50"]), milliseconds(world["step_s"]["p99"]), 1e3 * cycle_s);
  } else {
    gate.culprit = Culprit::os;
    gate.why = fmt::format("the OS woke the world late or pre-empted it in {:.0f} of {} cycles ({}); {}", by_os,
                           grouped(world["cycles"].get<std::uint64_t>()), load_text(summary), quiet_cure(world));
  }
  return gate;
}

/// Whether the energy that the operator gets is bounded.
bool passivity_acts(const Json& summary, const Json& user) {
  for (const Json& item : summary["settings"].value("plan", Json::array())) {
    if (item["item"] == "passivity" && item["user"] == user) return !item["enabled"].get<bool>();
  }
  return false;
}

const char* cure_of(const Json& spec) {
  return spec["kind"] == "admittance" ? "a heavier proxy, less delay or a smaller --ratio"
                                      : "a lower coupling stiffness_n_m, less delay or a smaller --ratio";
}

/// Energy that an operator was given and that neither the operator nor the bodies had.
Gate energy_gate(const std::string& who, const Json& haptic, const Json& device, const Json& spec,
                 const Json& summary) {
  const Json& energy = device["operator_energy"];
  const double work_j = haptic["device_work_j"].get<double>();
  const double allowed_j =
      summary["world"]["released_j"].get<double>() + std::max(kLeastEnergy_j, kUnexplainedRatio * std::abs(work_j));
  return {who + "created energy at the operator",
          energy["created_j"].get<double>(),
          allowed_j,
          true,
          "J",
          1.0,
          Culprit::unstable,
          fmt::format("neither the operator nor the bodies had it; {}{}", cure_of(spec),
                      passivity_acts(summary, haptic["user"]) ? "" : ", or --passivity on")};
}

/// An admittance device that its proxy leaves behind: the coupling no longer holds the proxy.
Gate runaway_gate(const std::string& who, const Json& haptic, const Json& spec, const Json& summary) {
  constexpr double kFree_m = 0.1, kRounds = 2.0;
  const Json& delay = summary["settings"]["delay"];
  double late_s = summary["h_s"].get<double>() * summary["ratio_most"].get<double>();
  for (const char* way : {"up_s", "down_s", "from_device_s", "to_device_s", "jitter_s"})
    late_s += delay[way].get<double>();
  const double speed_m_s = spec["speed_limit_m_s"].get<double>();
  return {who + "distance between proxy and device",
          haptic["proxy_apart_max_m"].get<double>(),
          kFree_m + kRounds * late_s * speed_m_s,
          true,
          "m",
          1.0,
          Culprit::unstable,
          fmt::format("the proxy ran away from its device, which moves at most at {:g} m/s; {}{}", speed_m_s,
                      cure_of(spec), passivity_acts(summary, haptic["user"]) ? "" : ", or --passivity on")};
}

/// Energy that the bodies gained beyond the operators' work and their own fall. The bound allows for what engines gain
/// and lose in contacts.
Gate world_energy_gate(const Json& summary) {
  constexpr double kOfTheWork = 0.25, kOfTheFall = 0.05;
  const Json& world = summary["world"];
  double work_j = 0.0;
  for (const Json& haptic : summary["haptic"]) work_j += std::abs(haptic["device_work_j"].get<double>());
  const double allowed_j = world["contact_slack_j"].get<double>() + std::max(kLeastEnergy_j, kOfTheWork * work_j) +
                           kOfTheFall * world["released_j"].get<double>();
  const bool late_paper = summary.value("scheme", "") == "paper";
  return {"energy that the bodies gained",
          summary["haptic"][0]["energy_excess_j"].get<double>(),
          allowed_j,
          true,
          "J",
          1.0,
          Culprit::unstable,
          late_paper
              ? "the operators did not put it in: with late messages the scheme paper creates it; --scheme reduced, or "
                "less delay"
              : "the operators did not put it in; a smaller --ratio, --preset quality, or another --engine"};
}

Gate oscillation_gate(const std::string& who, const Json& device, double force_limit_n, double simulated_s) {
  constexpr double kLeast_s = OscillationWatch::kBlock_s * (1.0 + OscillationWatch::kLasting);
  return {
      fmt::format("{}oscillation of the force{}", who,
                  simulated_s < kLeast_s
                      ? fmt::format(" (a run of less than {:g} s is too short to detect it)", kLeast_s)
                      : ""),
      device["oscillation_n"].get<double>(),
      kOscillationRatio * force_limit_n,
      true,
      "N RMS",
      1.0,
      Culprit::unstable,
      "the force oscillates faster than an operator moves; a lower coupling stiffness_n_m or damping_n_s_m, a smaller "
      "--ratio or h_s, or the scheme reduced"};
}

/// Samples of programs that do not belong to the run.
void add_foreign_writer_gates(std::vector<Gate>& all, const std::string& who, const Json& refused) {
  struct Sender {
    const char* topic;
    const char* program;
  };
  constexpr std::array kSenders{Sender{"scene", "world_sim"}, Sender{"world_frame", "world_sim"},
                                Sender{"haptic_report", "haptic_sim"}, Sender{"device_state", "device_sim"},
                                Sender{"device_command", "haptic_sim"}};
  for (const Sender& sender : kSenders) {
    if (!refused.contains(sender.topic)) continue;
    all.push_back(
        {fmt::format("{}{} from a foreign writer", who, sender.topic), refused[sender.topic].get<double>(), 0.0, true,
         "", 1.0, Culprit::foreign_writer,
         fmt::format("another program published them as {}, and they were refused; end it, or give it another --domain",
                     sender.program)});
  }
}

const char* name_of(Culprit culprit) {
  switch (culprit) {
    case Culprit::run:
      return "run";
    case Culprit::os:
      return "os";
    case Culprit::unstable:
      return "unstable";
    case Culprit::foreign_writer:
      return "foreign_writer";
    case Culprit::scene:
      break;
  }
  return "scene";
}

}  // namespace

std::string Gate::line() const {
  const std::string held = fmt::format("{} {:.4g}{}{} {} {:.4g}{}{}", name, scale * value, *unit ? " " : "", unit,
                                       at_most ? "<=" : ">=", scale * bar, *unit ? " " : "", unit);
  if (ok()) return held + ": ok";
  return fmt::format("{}: {}{}{}", held,
                     spoils_verdict()         ? "MISSED"
                     : culprit == Culprit::os ? "remark"
                                              : "warning",
                     why.empty() ? "" : ": ", why);
}

Json to_json(const Gate& gate) {
  Json json{{"name", gate.name},
            {"value", gate.value},
            {"bound", gate.bar},
            {"at_most", gate.at_most},
            {"unit", gate.scale == 100.0 ? "ratio"
                     : gate.scale == 1e3 ? "s"
                     : *gate.unit        ? gate.unit
                                         : "1"},
            {"ok", gate.ok()},
            {"warning", !gate.ok() && !gate.spoils_verdict()}};
  if (!gate.ok()) {
    json["missed_by"] = name_of(gate.culprit);
    json["why"] = gate.why;
  }
  return json;
}

std::vector<Gate> gates(const Json& summary) {
  std::vector<Gate> all;  // causes before their effects: a verdict gives the first reason
  const bool realtime = summary["mode"] == "realtime";
  const double h_s = summary["h_s"].get<double>();
  add_foreign_writer_gates(all, "", summary["world"]["refused"]);
  all.push_back(world_energy_gate(summary));
  for (const Json& haptic : summary["haptic"]) {
    const std::string who = fmt::format("user {}: ", haptic["user"].get<int>());
    const Json& device = summary["device"][haptic["user"].get<std::size_t>()];
    const Json& spec = summary["settings"]["users"][haptic["user"].get<std::size_t>()]["device"];
    add_foreign_writer_gates(all, who, haptic["refused"]);
    add_foreign_writer_gates(all, who, device["refused"]);
    if (spec["kind"] == "admittance") all.push_back(runaway_gate(who, haptic, spec, summary));
    all.push_back(energy_gate(who, haptic, device, spec, summary));
    all.push_back(
        oscillation_gate(who, device, spec["force_limit_n"].get<double>(), summary["simulated_s"].get<double>()));
    if (realtime) {
      const double periods = std::max(1.0, haptic["steps"].get<double>() + haptic["skipped_steps"].get<double>());
      const std::string why_run = why_the_run_missed(haptic, h_s);
      all.push_back({who + "missed by the run", haptic["missed_by_run"].get<double>() / periods, kMissedRatio, true,
                     "% of steps", 100.0, Culprit::run, why_run});
      const Gate by_os = os_gate(who, haptic, periods, summary);
      all.push_back(by_os);
      all.push_back(lateness_gate(who, haptic, by_os, why_run));
    }
    all.push_back(
        {who + "lost frames", haptic["lost_frames"].get<double>(), 0.0, true, "", 1.0, Culprit::run,
         "frames of the world were lost on the way; look for a slow network, or for a sub-world that was halted"});
    all.push_back(
        {who + "at the device's limit", haptic["at_limit_ratio"].get<double>(), kAtLimitRatio, true, "% of steps",
         100.0, Culprit::scene,
         "the operator feels the limit, not the scene; move the device less far into bodies, lower the coupling's "
         "stiffness, or raise the device's force_limit_n"});
  }
  if (realtime) all.push_back(clock_gate(summary));
  return all;
}

namespace {

/// "user 0: lateness p99 0.31 ms"
std::string figure(const Gate& gate) {
  return fmt::format("{} {:.4g}{}{}", gate.name, gate.scale * gate.value, *gate.unit ? " " : "", gate.unit);
}

/// How often the OS delayed the haptic loops, beside how often it does so to bare ones; empty: never.
std::string os_remark(const Json& summary) {
  if (summary["mode"] != "realtime") return {};
  std::uint64_t delayed = 0, periods = 0;
  for (const Json& haptic : summary["haptic"]) {
    delayed += haptic["missed_by_os"].get<std::uint64_t>();
    periods += haptic["steps"].get<std::uint64_t>() + haptic["skipped_steps"].get<std::uint64_t>();
  }
  if (delayed == 0) return {};
  const std::string bare = calibration_text(summary);
  return fmt::format("the OS delayed {} of {} steps past their deadline ({:.2g} %){}{}", grouped(delayed),
                     grouped(periods), 100.0 * static_cast<double>(delayed) / static_cast<double>(periods),
                     bare.empty() ? "" : "; ", bare);
}

}  // namespace

std::string verdict_of(const std::vector<Gate>& gates, const Json& summary) {
  std::string unstable, foreign, missed;
  for (const Gate& gate : gates) {
    if (!gate.spoils_verdict()) continue;
    std::string& first = gate.culprit == Culprit::unstable         ? unstable
                         : gate.culprit == Culprit::foreign_writer ? foreign
                                                                   : missed;
    if (first.empty()) first = fmt::format("{}: {}", figure(gate), gate.why);
  }
  // One reason is enough; `gates` has all of them. A foreign writer may be the cause of any other.
  if (!unstable.empty()) return "unstable: " + unstable + (foreign.empty() ? "" : "; also " + foreign);
  if (!foreign.empty()) return "quality gate missed: " + foreign;
  if (!missed.empty()) return "quality gate missed: " + missed;
  std::string text = "ok";
  if (const std::string remark = os_remark(summary); !remark.empty()) text += "; " + remark;
  for (const Gate& gate : gates) {
    const bool said = gate.name.ends_with("missed by the OS");
    if (!gate.ok() && !said)
      text += fmt::format("; {}{}", figure(gate), gate.culprit == Culprit::os ? ", by the OS" : "");
  }
  return text;
}

std::vector<std::string> missed_strictly(const std::vector<Gate>& gates) {
  std::vector<std::string> names;
  for (const Gate& gate : gates) {
    if (gate.counts_strictly()) names.push_back(gate.name);
  }
  return names;
}

}  // namespace subworld
