#include "run/placement.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace subworld {

namespace {

/// Room for the nearest members, however many users there are.
constexpr double kLeastBudget = 0.02;

/// What each user's programs take of a core beside the simulation. Fitted to runs with 1 to 8 users on an AMD EPYC: a
/// haptic step, a device step and their messages, and the state of the device for each peer.
double core_share(const Scene& scene) {
  constexpr double kStep_s = 150e-6, kPeer_s = 27e-6;
  return (kStep_s + kPeer_s * static_cast<double>(scene.users.size())) / scene.settings.h_s;
}

}  // namespace

Placement place(const Scene& scene, std::span<const int> cores) {
  if (scene.settings.mode != Mode::realtime || cores.size() < 2) return {};
  double wanted = 0.0;
  for (const UserSpec& user : scene.users) wanted += 0.5 * user.budget_ratio + core_share(scene);
  const std::span<const int> others = cores.first(cores.size() - 1);
  if (wanted > static_cast<double>(others.size())) return {};
  return {.world = {cores.back()}, .others = {others.begin(), others.end()}};
}

double budget_limit_ratio(const Scene& scene, std::size_t cores) {
  const double users = std::max(1.0, static_cast<double>(scene.users.size()));
  const double left = static_cast<double>(cores) - users * core_share(scene);
  return std::max(kLeastBudget, 0.5 * left / users);
}

std::string to_text(const std::vector<int>& cores) { return fmt::format("{}", fmt::join(cores, ",")); }

}  // namespace subworld
