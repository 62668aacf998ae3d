#include "model/mechanisms.hpp"

#include "model/disjoint_sets.hpp"

#include <algorithm>
#include <map>

namespace subworld {

Mechanisms::Mechanisms(const Scene& scene) : scene_(scene), broken_(scene.joints.size()) {
  if (!scene.joints.empty()) find();
}

void Mechanisms::find() {
  DisjointSets sets;
  sets.reset(scene_.bodies.size());
  std::vector<BodyId> joined;
  for (std::size_t j = 0; j < scene_.joints.size(); ++j) {
    const auto [a, b] = std::pair(scene_.joints[j].a, scene_.joints[j].b);
    if (broken_[j] || scene_.body(a).fixed() || scene_.body(b).fixed()) continue;
    const std::uint32_t root_a = sets.root(index(a)), root_b = sets.root(index(b));
    if (root_a != root_b) sets.join(root_a, root_b);
    joined.insert(joined.end(), {a, b});
  }
  std::ranges::sort(joined);
  const auto twice = std::ranges::unique(joined);
  joined.erase(twice.begin(), twice.end());
  group_.assign(scene_.bodies.size(), 0);
  groups_.assign(1, {});
  std::map<std::uint32_t, std::uint32_t> numbers;
  for (const BodyId id : joined) {
    const auto [at, is_new] = numbers.try_emplace(sets.root(index(id)), static_cast<std::uint32_t>(groups_.size()));
    if (is_new) groups_.emplace_back();
    group_[index(id)] = at->second;
    groups_[at->second].push_back(id);
  }
}

void Mechanisms::complete(std::vector<BodyId>& ids) const {
  if (groups_.empty()) return;
  const std::size_t count = ids.size();
  for (std::size_t i = 0; i < count; ++i) {
    const std::span<const BodyId> with = of(ids[i]);
    ids.insert(ids.end(), with.begin(), with.end());
  }
  if (ids.size() == count) return;
  std::ranges::sort(ids);
  const auto twice = std::ranges::unique(ids);
  ids.erase(twice.begin(), twice.end());
}

void Mechanisms::break_joint(std::size_t joint) {
  broken_[joint] = true;
  find();
}

}  // namespace subworld
