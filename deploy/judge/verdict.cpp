#include "judge/causes.hpp"
#include "judge/gates.hpp"
#include "judge/summary.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstdint>

namespace subworld {

namespace {

/// How often the OS delayed the haptic loops, beside how often it does so to bare ones; empty: never.
std::string os_remark(const RunResults& run) {
  std::uint64_t delayed = 0, periods = 0;
  for (const HapticResult& haptic : run.haptic) {
    delayed += haptic.missed_by_os;
    periods += haptic.steps + haptic.skipped_steps;
  }
  if (!run.realtime() || delayed == 0) return {};
  const std::string bare = calibration_text(run);
  return fmt::format("; the OS delayed {} of {} steps past their deadline ({:.2g} %){}{}", grouped(delayed),
                     grouped(periods), 100.0 * static_cast<double>(delayed) / static_cast<double>(periods),
                     bare.empty() ? "" : "; ", bare);
}

/// No run knows what its operators would have felt without a delay of some cycles.
std::string delay_remark(const RunResults& run) {
  const Settings& settings = run.scene.settings;
  double round_trip_s = run.realtime() ? 0.0 : settings.delay.up_s + settings.delay.down_s;
  if (run.has_unknown_delay())
    for (const HapticResult& haptic : run.haptic) round_trip_s = std::max(round_trip_s, haptic.round_trip_s.p50);
  if (run.haptic.empty() || round_trip_s < 3.0 * settings.longest_cycle_s()) return {};
  return fmt::format(
      "; the round trip to the world took {:.3g} ms{}{}. No gate judges the force error of such a delay: `subworld lab "
      "latency {}` measures it",
      1e3 * round_trip_s, run.realtime() ? " (p50)" : "", link_text(run), run.scene.name);
}

std::string absence_text(const Absence& one, double end_s) {
  if (!one.by_order) return fmt::format("; user {} absent from {:.2f} to {:.2f} s", one.user, one.from_s, one.to_s);
  if (one.from_s > 0.0) return fmt::format("; user {} left at {:.2f} s", one.user, one.from_s);
  if (one.to_s < end_s) return fmt::format("; user {} joined at {:.2f} s", one.user, one.to_s);
  return fmt::format("; user {} took no part", one.user);
}

/// "; user 1 absent from 1.20 to 2.00 s" for each absence, and who was started again.
std::string absences_text(const RunResults& run) {
  std::string text;
  for (const Restarted& one : run.restarts) text += fmt::format("; {} was started again ({})", one.program, one.reason);
  for (const Absence& one : run.world.absences) text += absence_text(one, run.ending.to_s);
  for (const DeviceResult& one : run.device) {
    if (!one.driver) continue;
    const DriverResult& driver = *one.driver;
    if (driver.absences > 0)
      text += fmt::format("; device {} of user {} was absent {} time{}, {:.2f} s in total", driver.name, one.user,
                          driver.absences, driver.absences == 1 ? "" : "s", driver.absent_s);
    if (driver.refused > 0)
      text += fmt::format("; device {} of user {}: readings refused: {}", driver.name, one.user, driver.refused_for);
  }
  return text;
}

}  // namespace

std::string verdict_of(const std::vector<Gate>& gates, const RunResults& run) {
  std::string unstable, foreign, missed;
  for (const Gate& gate : gates) {
    if (!gate.spoils_verdict()) continue;
    std::string& reason = gate.cause.culprit == Culprit::unstable         ? unstable
                          : gate.cause.culprit == Culprit::foreign_writer ? foreign
                                                                          : missed;
    if (reason.empty()) reason = fmt::format("{}: {}", gate.figure(), gate.cause.why);
  }
  // One reason is enough; `gates` has all of them. A foreign writer may be the cause of any other.
  const std::string absences = absences_text(run), delay = delay_remark(run);
  if (!unstable.empty())
    return "unstable: " + unstable + (foreign.empty() ? "" : "; also " + foreign) + absences + delay;
  if (!foreign.empty() || !missed.empty())
    return "quality gate missed: " + (foreign.empty() ? missed : foreign) + absences + delay;
  std::string text = "ok" + absences + os_remark(run);
  for (const Gate& gate : gates) {
    const bool said = gate.name.ends_with(kMissedByTheOs);
    if (!gate.ok() && !said)
      text += fmt::format("; {}{}", gate.figure(),
                          gate.cause.culprit == Culprit::os        ? ", by the OS"
                          : gate.cause.culprit == Culprit::network ? ", by the network"
                                                                   : "");
  }
  return text + delay;
}

}  // namespace subworld
