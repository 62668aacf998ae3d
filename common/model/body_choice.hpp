#pragma once

#include "model/scene.hpp"

#include <string_view>
#include <vector>

namespace subworld {

/// The bodies of a list such as "proxy,cube*,tower/?", each once, in the order of the scene: names, patterns in which
/// `*` stands for any characters and `?` for one, or "all" for all that can move. A pattern means fixed bodies as well.
/// Throws `Error` (usage) for a word that no body has, with the nearest name.
[[nodiscard]] std::vector<BodyId> choose_bodies(const Scene& scene, std::string_view list);

/// Whether a name is one of a pattern's.
[[nodiscard]] bool matches(std::string_view pattern, std::string_view name) noexcept;

}  // namespace subworld
