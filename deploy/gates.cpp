#include "gates.hpp"

#include "coupling/oscillation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace subworld {

double milliseconds(const Json& seconds) { return 1e3 * seconds.get<double>(); }

std::string load_text(const Json& summary) {
  const Json& load = summary["machine_load"];
  return fmt::format("of {} cores our programs used {:.2f}, others {:.2f}, the hypervisor {:.2f}",
                     summary["machine"]["cores"].get<int>(), load["own_cores"].get<double>(),
                     load["other_cores"].get<double>(), load["stolen_cores"].get<double>());
}

std::string calibration_text(const Json& summary) {
  if (!summary.contains("calibration")) return {};
  const Json& calibration = summary["calibration"];
  return fmt::format("calibration: {} in {} bare wake-ups", calibration["late"].get<std::uint64_t>(),
                     calibration["wake_ups"].get<std::uint64_t>());
}

namespace {

constexpr double kMissedRatio = 0.001;
constexpr double kLatenessP99_s = 0.25e-3;
constexpr double kAtLimitRatio = 0.01;
/// Least energy that counts, J: a device of 0.1 kg at 0.3 m/s, or a coupling of 1000 N/m that is stretched by 3 mm.
constexpr double kLeastEnergy_j = 0.005;
constexpr double kUnexplainedRatio = 0.01;  ///< of the energy that users put in
constexpr double kOscillationRatio = 0.05;  ///< of the device's force limit

constexpr double kFullCores = 0.8;   ///< share of the cores that our programs use: they hold each other up
constexpr double kQuietCores = 0.1;  ///< cores that others or the hypervisor take

/// Whether the loops of the run, more than anything else, kept this loop from its core for `lost_s`. Where nothing else
/// runs, who waits in the queue of a core with a real-time priority waits for another loop of ours, if there is one of
/// at least its priority: a rival.
bool delayed_by_the_run(const Json& loop, double lost_s, bool has_rivals, const Json& summary) {
  const Json& load = summary["machine_load"];
  const bool quiet = load["other_cores"].get<double>() + load["stolen_cores"].get<double>() < kQuietCores;
  const bool full = load["own_cores"] > kFullCores * summary["machine"]["cores"].get<double>();
  return quiet && (full || (has_rivals && loop["machine"]["run_queue_delay_s"].get<double>() > lost_s));
}

/// Why a loop's own steps miss deadlines.
std::string why_the_run_missed(const Json& haptic, double h_s) {
  const double us = haptic["missed_by_run"].get<double>();
  if (haptic["missed_waiting"].get<double>() > 0.5 * us) {
    return "steps slept or waited for a lock, most likely in the middleware: look for a network that is slow, or try "
           "the "
           "other --dds";
  }
  return fmt::format(
      "steps take {:.2f} ms (p99 {:.2f}) of {:g} ms; fewer members: a lower budget_ratio or a smaller box_half_m; a "
      "faster preset or engine; "
      "or a "
      "longer h_s",
      milliseconds(haptic["step_s"]["p50"]), milliseconds(haptic["step_s"]["p99"]), 1e3 * h_s);
}

Gate os_gate(const std::string& who, const Json& haptic, double periods, const Json& summary) {
  const double missed = haptic["missed_by_os"].get<double>();
  Gate gate{who + "missed by the machine", missed / periods, kMissedRatio, true, "% of steps", 100.0};
  if (delayed_by_the_run(haptic, missed * summary["h_s"].get<double>(), summary["users"] > 1, summary)) {
    gate.why = fmt::format(
        "the programs of the run keep each other from the cores (this loop was ready for {:.0f} ms without one; {}); "
        "fewer members or users, more cores, a higher ratio, or a longer h_s",
        milliseconds(haptic["machine"]["run_queue_delay_s"]), load_text(summary));
  } else {
    gate.culprit = Culprit::os;
    gate.why = fmt::format("the loop was woken late or pre-empted ({}; {}); run again when the machine is quiet",
                           calibration_text(summary), load_text(summary));
    if (!haptic["machine"]["fifo"].get<bool>()) gate.why += ", or with real-time rights";
  }
  return gate;
}

/// Whether the energy that the hand gets is bounded.
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

/// Energy that a hand was given and that neither it nor the bodies had.
Gate energy_gate(const std::string& who, const Json& haptic, const Json& device, const Json& spec,
                 const Json& summary) {
  const Json& energy = device["operator_energy"];
  const double work_j = haptic["device_work_j"].get<double>();
  const double allowed_j =
      summary["world"]["released_j"].get<double>() + std::max(kLeastEnergy_j, kUnexplainedRatio * std::abs(work_j));
  return {who + "created energy at the hand",
          energy["created_j"].get<double>(),
          allowed_j,
          true,
          "J",
          1.0,
          Culprit::unstable,
          fmt::format("neither the hand nor the bodies had it: {}{}", cure_of(spec),
                      passivity_acts(summary, haptic["user"]) ? "" : ", or --passivity on")};
}

/// An admittance device that its proxy leaves behind: nothing holds the proxy any more.
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
          fmt::format("the proxy ran away from its device, which moves at most at {:g} m/s: {}{}", speed_m_s,
                      cure_of(spec), passivity_acts(summary, haptic["user"]) ? "" : ", or --passivity on")};
}

/// Energy that the bodies gained and that neither hands nor their own fall had. What an engine gains and loses in
/// contacts is let pass.
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
              ? "nobody put it in: with late messages the scheme paper creates it; --scheme reduced, or less delay"
              : "nobody put it in: a smaller --ratio, --preset quality, or another --engine"};
}

Gate oscillation_gate(const std::string& who, const Json& device, double force_limit_n, double simulated_s) {
  constexpr double kLeast_s = OscillationWatch::kBlock_s * (1.0 + OscillationWatch::kLasting);
  return {
      fmt::format(
          "{}oscillation of the force{}", who,
          simulated_s < kLeast_s ? fmt::format(" (a run of less than {:g} s is too short to tell)", kLeast_s) : ""),
      device["oscillation_n"].get<double>(),
      kOscillationRatio * force_limit_n,
      true,
      "N rms",
      1.0,
      Culprit::unstable,
      "the force swings faster than a hand moves: a lower coupling stiffness_n_m or damping_n_s_m, a smaller --ratio "
      "or h_s, or the scheme reduced"};
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
    all.push_back({fmt::format("{}{} from a stranger", who, sender.topic), refused[sender.topic].get<double>(), 0.0,
                   true, "", 1.0, Culprit::foreign_writer,
                   fmt::format("another program sent them as {}, and they were refused; end it, or give it another "
                               "--domain",
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
  return fmt::format("{}: {}{}{}", held, spoils_verdict() ? "MISSED" : "warning", why.empty() ? "" : ": ", why);
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
  std::vector<Gate> all;  // causes before what follows from them: a verdict gives the first reason
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
      const std::string why_us = why_the_run_missed(haptic, h_s);
      all.push_back({who + "missed by us", haptic["missed_by_run"].get<double>() / periods, kMissedRatio, true,
                     "% of steps", 100.0, Culprit::run, why_us});
      const Gate by_os = os_gate(who, haptic, periods, summary);
      all.push_back(by_os);
      const bool woken_late = haptic["woken_late_s"]["p99"].get<double>() > kLatenessP99_s;
      all.push_back({who + "lateness p99", haptic["lateness_s"]["p99"].get<double>(), kLatenessP99_s, true, "ms", 1e3,
                     woken_late ? by_os.culprit : Culprit::run, woken_late ? by_os.why : why_us});
    }
    all.push_back({who + "lost frames", haptic["lost_frames"].get<double>(), 0.0, true, "", 1.0, Culprit::run,
                   "frames of the world were lost on the way: the network, or a sub-world that was halted"});
    all.push_back(
        {who + "at the device's limit", haptic["at_limit_ratio"].get<double>(), kAtLimitRatio, true, "% of steps",
         100.0, Culprit::scene,
         "the hand feels the limit, not the scene: move the device less far into bodies, lower the coupling's "
         "stiffness, or raise the device's force_limit_n"});
  }
  if (realtime) {
    const Json& world = summary["world"];
    const double by_run = world["late_by_run"].get<double>(), by_os = world["late_by_os"].get<double>();
    const bool has_own_core = !summary["placement"]["world"].empty();
    const double cycle_s = h_s * world["ratio"]["mean"].get<double>();
    const bool ours = by_run > by_os || delayed_by_the_run(world, by_os * cycle_s, !has_own_core, summary);
    all.push_back(
        {"world real-time factor", world["real_time_factor_min"].get<double>(), 1.0, false, "", 1.0,
         ours ? Culprit::run : Culprit::os,
         ours ? fmt::format(
                    "the world's step takes {:.2f} ms (p99 {:.2f}) of cycles of {:.3g} ms; a higher ratio, fewer "
                    "bodies, or a faster preset or engine",
                    milliseconds(world["step_s"]["p50"]), milliseconds(world["step_s"]["p99"]), 1e3 * cycle_s)
              : fmt::format("the world was woken late or pre-empted ({}); run again when the machine is quiet",
                            load_text(summary))});
  }
  return all;
}

std::string verdict_of(const std::vector<Gate>& gates, const Json& summary) {
  std::vector<std::string> unstable, foreign, ours, machines;
  for (const Gate& gate : gates) {
    if (!gate.spoils_verdict()) continue;
    std::vector<std::string>& words = gate.culprit == Culprit::unstable         ? unstable
                                      : gate.culprit == Culprit::foreign_writer ? foreign
                                      : gate.culprit == Culprit::os             ? machines
                                                                                : ours;
    const std::string text = fmt::format("{} {:.4g}{}{}: {}", gate.name, gate.scale * gate.value, *gate.unit ? " " : "",
                                         gate.unit, gate.why);
    words.push_back(text);
  }
  // One reason is enough; all of them are in the gates. A stranger may be the reason, and is named in any case.
  if (!unstable.empty()) return "unstable: " + unstable.front() + (foreign.empty() ? "" : "; also " + foreign.front());
  if (!foreign.empty()) return "quality gate missed: " + foreign.front();
  if (!ours.empty()) return "quality gate missed: " + ours.front();
  if (!machines.empty()) return "quality gate missed by the machine: " + machines.front();
  std::uint64_t late = 0, periods = 0;
  for (const Json& haptic : summary["haptic"]) {
    late += haptic["missed_by_os"].get<std::uint64_t>();
    periods += haptic["steps"].get<std::uint64_t>() + haptic["skipped_steps"].get<std::uint64_t>();
  }
  std::string text = "ok";
  for (const Gate& gate : gates) {
    if (!gate.ok()) text += fmt::format("; {} {:.4g} {}", gate.name, gate.scale * gate.value, gate.unit);
  }
  if (late == 0) return text;
  return text + fmt::format("; the machine itself was late {} time{} in {} steps ({})", late, late == 1 ? "" : "s",
                            periods, calibration_text(summary));
}

}  // namespace subworld
