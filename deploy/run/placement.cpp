#include "run/placement.hpp"

#include "io/options/options.hpp"
#include "model/joined.hpp"
#include "physics/engine.hpp"
#include "rt/scheduling.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace subworld {

namespace {

/// Room for the nearest members, however many users there are.
constexpr double kLeastBudget = 0.02;

/// Of a world's engine, if nobody asks for more: a step's serial part is half of it.
constexpr int kMostThreads = 8;

/// What each user's programs take of a core beside the simulation. Fitted to runs with 1 to 8 users on an AMD EPYC: a
/// haptic step, a device step and their messages, and the state of the device for each peer.
double core_share(const Scene& scene) {
  constexpr double kStep_s = 150e-6, kPeer_s = 27e-6;
  return (kStep_s + kPeer_s * static_cast<double>(scene.users.size())) / scene.settings.h_s;
}

}  // namespace

Placement place(const Scene& scene, std::span<const int> cores, double keys_s) {
  if (scene.settings.mode != Mode::realtime || cores.size() < 2) return {};
  double wanted = 0.0;
  for (const UserSpec& user : scene.users)
    wanted += 0.5 * user.budget_ratio + core_share(scene) + keys_s / scene.settings.h_s;
  if (wanted > static_cast<double>(cores.size() - 1)) return {};
  // An engine that shares its steps gets what the others leave.
  const EngineSettings& engine = scene.settings.world;
  const auto most =
      static_cast<std::size_t>(engine.threads.value_or(engine_cost(engine).parallel_ratio > 0.0 ? kMostThreads : 1));
  const auto needed = static_cast<std::size_t>(std::max(1.0, std::ceil(wanted)));
  const std::span<const int> world = cores.last(std::clamp<std::size_t>(cores.size() - needed, 1, most));
  const std::span<const int> left = cores.first(cores.size() - world.size());
  return {.world = {world.begin(), world.end()}, .others = {left.begin(), left.end()}};
}

double budget_limit_ratio(const Scene& scene, std::size_t cores) {
  const double users = std::max(1.0, static_cast<double>(scene.users.size()));
  const double left = static_cast<double>(cores) - users * core_share(scene);
  return std::max(kLeastBudget, 0.5 * left / users);
}

Calibration measure_machine(const Settings& settings) {
  const double duration_s = std::clamp(0.1 * settings.duration_s, 0.2, 1.0);
  fmt::print("subworld: measuring for {:.1f} s how late this machine wakes a loop without work\n", duration_s);
  std::fflush(stdout);
  const int cores = std::max(1, static_cast<int>(allowed_cores().size()));
  const Calibration found = calibrate(std::min(settings.users, cores), settings.h_s, duration_s);
  const Histogram& late = found.lateness;
  fmt::print(
      "subworld: this machine wakes {} at {:.0f} Hz p99 {:.3f} ms late, at most {:.3f} ms, {} of {} times later than a "
      "period\n",
      found.loops == 1 ? "a bare loop" : fmt::format("{} bare loops", found.loops), 1.0 / found.period_s,
      1e3 * late.quantile_s(0.99), 1e3 * late.max_s(), late.count_above(found.period_s), late.count());
  if (!found.granted.fifo || !found.granted.memory_locked) {
    fmt::print("subworld: warning: without all real-time rights deadlines may be missed: {}\n", found.granted.text);
  }
  std::fflush(stdout);
  return found;
}

void share_cores(Options& options, Scene& scene) {
  if (!flag_of(options, "users.budget_ratio").empty()) return;
  const std::size_t cores = allowed_cores().size();
  const double most = budget_limit_ratio(scene, cores);
  for (std::size_t u = 0; u < scene.users.size(); ++u) {
    UserSpec& user = scene.users[u];
    if (user.selection != Selection::budget || user.budget_ratio <= most) continue;
    user.budget_ratio = most;
    change(options, fmt::format("users[{}].budget_ratio", u), fmt::format("{}", most));
  }
  if (flag_of(options, "users.budget_ratio").empty()) return;
  fmt::print("subworld: {} users share {} core{}: budget_ratio at most {:.2g} (--set users.budget_ratio sets it)\n",
             scene.users.size(), cores, cores == 1 ? "" : "s", most);
}

void share_steps(Options& options, Scene& scene, const Placement& placement) {
  if (scene.settings.world.threads || placement.world.size() < 2) return;
  scene.settings.world.threads = static_cast<int>(placement.world.size());
  change(options, "world.threads", fmt::format("{}", placement.world.size()));
}

bool is_placed_by_hand(const std::string& program) {
  std::string variable = "SUBWORLD_" + program + "_CORE";
  std::ranges::transform(variable, variable.begin(), [](unsigned char c) { return std::toupper(c); });
  return std::getenv(variable.c_str()) != nullptr;
}

std::string to_text(const std::vector<int>& cores) { return joined(cores, ","); }

}  // namespace subworld
