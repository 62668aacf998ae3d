#include "placement.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace subworld {

Placement place(const Scene& scene, std::span<const int> cores) {
  if (scene.settings.mode != Mode::realtime || cores.size() < 2) return {};
  double wanted = 0.0;
  for (const UserSpec& user : scene.users) wanted += user.budget_ratio;
  const std::span<const int> others = cores.first(cores.size() - 1);
  if (wanted > static_cast<double>(others.size())) return {};
  return {.world = {cores.back()}, .others = {others.begin(), others.end()}};
}

std::string to_text(const std::vector<int>& cores) { return fmt::format("{}", fmt::join(cores, ",")); }

}  // namespace subworld
