#include "watch/watchdog.hpp"

#include "wire/session.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

namespace subworld {

namespace {

constexpr double kStalled_s = 3.0;  // a loop in lock-step names after 2 s the peer that it waits for

}  // namespace

std::string Watchdog::observe(const Status& status, double now_s) {
  if (status.program == ProgramKind::world_sim) paused_ = status.paused;
  Clock& clock = clocks_[{status.program, status.instance}];
  const bool steps = status.state == "running" && status.steps > 0;
  std::string label = label_of(status.program, status.instance);
  std::ranges::replace(label, ' ', '_');  // as its log is named
  if (!steps || paused_ || status.time_s != clock.time_s) {
    const bool advances = clock.named && steps && !paused_;
    clock = {status.time_s, now_s, false};
    return advances ? label + " advances again" : "";
  }
  const double stalled_s = now_s - clock.since_s;
  if (stalled_s <= kStalled_s || !status.waits_for.empty()) return {};
  if (stalled_s > longest_.for_s) longest_ = {label, status.time_s, stalled_s};
  if (std::exchange(clock.named, true)) return {};
  return fmt::format("{} has not advanced from t = {:.3f} s for {:.0f} s and waits for no peer: it is busy or stuck",
                     label, status.time_s, stalled_s);
}

}  // namespace subworld
