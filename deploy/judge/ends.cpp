#include "judge/ends.hpp"

#include "io/results/json.hpp"
#include "judge/summary.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

namespace subworld {

namespace {

constexpr double kLateStart_cycles = 10.0;  // in real time a user's first frame may be one of the next
constexpr double kLateEnd_cycles = 20.0;    // and the sub-world may lag behind the world
constexpr double kLateEnd_s = 0.25;
constexpr double kReturn_s = 1.0;  // between a first frame and the first report that the world uses

bool stopped_by_signal(const Ending& ending) { return ending.by.starts_with("SIG"); }

std::string stopped_text(const Ending& ending, double duration_s) {
  return fmt::format("was stopped by {} at t = {:.3f} of {:g} s", ending.by, ending.to_s, duration_s);
}

}  // namespace

std::string early_end(const std::string& part_file, double duration_s) {
  if (!std::filesystem::exists(part_file)) return {};
  const auto ending = read_json(part_file).at("ending").get<Ending>();
  return stopped_by_signal(ending) ? stopped_text(ending, duration_s) : "";
}

std::vector<std::string> faults_of(const RunResults& run) {
  std::vector<std::string> faults;
  const Settings& settings = run.scene.settings;
  const double cycle_s = settings.longest_cycle_s(), end_s = run.ending.to_s;
  const auto dismissed = [&](std::size_t user) {
    return std::ranges::any_of(run.world.absences,
                               [&](const Absence& one) { return one.user == user && one.by_order; });
  };
  const auto check = [&](const std::string& who, const Ending& ending, bool may_be_of_the_world_before = false) {
    if (stopped_by_signal(ending)) faults.push_back(who + " " + stopped_text(ending, settings.duration_s));
    if (!ending.fault.empty()) faults.push_back(who + ": " + ending.fault);
    if (ending.session != run.ending.session && !may_be_of_the_world_before)
      faults.push_back(who + " took part in another world's run");
  };
  check("world_sim", run.ending);
  for (const HapticResult& haptic : run.haptic) {
    const double from_s = haptic.ending.from_s, to_s = haptic.ending.to_s;
    const std::string who = fmt::format("haptic_sim_{}", haptic.user);
    // One who left before the world was started again has the results of the world before.
    check(who, haptic.ending, run.world.resumed_from_s && dismissed(haptic.user));
    // One that was started again serves from the end of an absence on.
    const bool returned = std::ranges::any_of(run.world.absences, [&](const Absence& one) {
      return one.user == haptic.user && std::abs(one.to_s - from_s) < kReturn_s;
    });
    if (dismissed(haptic.user)) continue;
    if ((from_s > run.ending.from_s + kLateStart_cycles * cycle_s && !returned) ||
        to_s < end_s - std::max(kLateEnd_s, kLateEnd_cycles * cycle_s))
      faults.push_back(fmt::format("{} served its user from {:.3f} to {:.3f} s, the world ran to {:.3f} s", who, from_s,
                                   to_s, end_s));
  }
  for (const DeviceResult& device : run.device) {
    check(fmt::format("device_sim_{}", device.user), device.ending, run.world.resumed_from_s && dismissed(device.user));
  }
  return faults;
}

}  // namespace subworld
