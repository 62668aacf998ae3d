#include "judge/causes.hpp"

#include "coupling/plan.hpp"
#include "wire/topics.hpp"

#include <fmt/core.h>

#include <algorithm>

namespace subworld {

namespace {

constexpr double kLongStep = 0.5;    ///< part of the cycle: a p99 below it slows no clock
constexpr double kFullCores = 0.8;   ///< part of the cores; above it the programs of the run delay each other
constexpr double kQuietCores = 0.1;  ///< cores that other programs and the hypervisor use on a quiet machine

}  // namespace

std::string load_text(const RunResults& run) {
  if (!run.load) return {};
  return fmt::format("of {} cores{} the run used {:.2f}, other programs {:.2f}, the hypervisor {:.2f}", run.cores,
                     run.quota ? fmt::format(", of which {} grants {:.2g},", run.quota->file, run.quota->cores) : "",
                     run.load->own, run.load->other, run.load->stolen);
}

std::string calibration_text(const RunResults& run) {
  if (!run.calibration) return {};
  return fmt::format("bare loops on this machine: {} of {} wake-ups late", grouped(run.calibration->late),
                     grouped(run.calibration->wake_ups));
}

Cause by_late_wake_ups(const char* who, const MachineShare& machine, double usual_late_s, std::uint64_t delayed,
                       double steps, double lost_s, bool has_rivals, const RunResults& run) {
  const auto brackets = [&](const std::string& first) {
    const std::string load = load_text(run);
    return first.empty() && load.empty()
               ? ""
               : fmt::format(" ({}{}{})", first, first.empty() || load.empty() ? "" : "; ", load);
  };
  constexpr double kUsedUp = 0.8;
  if (run.quota && run.load && run.load->own > kUsedUp * run.quota->cores) {
    return {Culprit::os,
            fmt::format("the run's control group grants it {:.2g} cores, of which it used {:.2f}; raise {} (of a "
                        "container: --cpus)",
                        run.quota->cores, run.load->own, run.quota->file)};
  }
  const bool quiet = !run.load || run.load->other + run.load->stolen < kQuietCores;
  const bool full = run.load && run.load->own > kFullCores * run.cores;
  const double bare = run.calibration ? static_cast<double>(run.calibration->late) /
                                            std::max(1.0, static_cast<double>(run.calibration->wake_ups))
                                      : 0.0;
  if (quiet && static_cast<double>(delayed) > bare * steps && (has_rivals || (full && !machine.fifo)) &&
      machine.run_queue_delay_s - steps * usual_late_s > lost_s) {
    return {Culprit::run,
            fmt::format("the programs of the run compete for the cores{}; fewer users or members, more cores, a higher "
                        "ratio, or a longer h_s",
                        brackets(fmt::format("the {} was ready for {:.0f} ms without one", who,
                                             1e3 * machine.run_queue_delay_s)))};
  }
  return {Culprit::os,
          fmt::format("the OS woke the {} late or pre-empted it{}; run {}again when the machine is quiet", who,
                      brackets(calibration_text(run)), machine.fifo ? "" : "with real-time rights, or ")};
}

Cause by_own_steps(const UserOfRun& at) {
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

Cause by_slow_cycles(const RunResults& run) {
  const WorldResult& world = run.world;
  const double cycle_s = run.scene.settings.h_s * world.ratio.mean();
  const bool steps_are_long = world.step_s.p99 > kLongStep * cycle_s;
  if (world.late_by_run > world.late_by_os || (steps_are_long && world.late_by_os == 0)) {
    const std::string times =
        fmt::format("p99 {:.2f} ms) of cycles of {:.3g} ms", 1e3 * world.step_s.p99, 1e3 * cycle_s);
    return {Culprit::run,
            steps_are_long
                ? fmt::format("the world's step takes {:.2f} ms ({}; a higher ratio, fewer bodies, or a faster preset "
                              "or engine",
                              1e3 * world.step_s.p50, times)
                : fmt::format("{} of {} cycles were too long, the longest {:.2f} ms; the others fit ({}; --trace FILE "
                              "shows what they did",
                              grouped(world.late_by_run), grouped(world.cycles), 1e3 * world.step_s.max, times)};
  }
  if (world.late_by_os == 0) return {Culprit::os, ""};  // no cycle was late: nothing to cure
  return by_late_wake_ups("world", world.machine, world.woken_late_s.p50, world.late_by_os,
                          static_cast<double>(world.cycles), static_cast<double>(world.late_by_os) * cycle_s,
                          run.placement.world.empty(), run);
}

std::string link_text(const RunResults& run) {
  const DelaySettings& d = run.scene.settings.delay;
  if (run.link) return fmt::format(" (link: {})", *run.link);
  if (!run.realtime() || !d.any()) return {};
  return fmt::format(" (artificial delay {:g} ms, jitter {:g} ms, loss {:g} %)", 1e3 * (d.up_s + d.down_s),
                     1e3 * d.jitter_s, 1e2 * d.loss_ratio);
}

Cause by_loss(const UserOfRun& at) {
  const double halted_s = static_cast<double>(at.haptic().skipped_steps) * at.settings().h_s;
  const double history_s = static_cast<double>(kTopicOf<WorldFrame>.depth) * at.settings().h_s * at.settings().ratio;
  if (at.run.has_unknown_delay() && halted_s < history_s)
    return {Culprit::network, fmt::format("frames of the world were lost on the way{}; look for loss and delay with "
                                          "`subworld lab network`",
                                          link_text(at.run))};
  return {Culprit::run,
          "frames of the world were lost on the way; the sub-world was halted, or the network is too slow"};
}

std::string coupling_cure(const UserOfRun& at) {
  return fmt::format("{}, less delay or a smaller --ratio{}",
                     at.spec().kind == DeviceKind::admittance ? "a heavier proxy" : "a lower coupling stiffness_n_m",
                     enabled(at.run.scene, Optimisation::energy_bound, at.user) ? ", or --passivity on" : "");
}

}  // namespace subworld
