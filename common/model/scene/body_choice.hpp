#pragma once

#include "model/scene/scene.hpp"

#include <string>
#include <string_view>
#include <vector>

namespace subworld {

/// The bodies of a list such as "proxy,cube*,tower/?", each once, in the order of the scene. An item is a name, a
/// pattern (`*` matches any characters, `?` one), or "all" for all movable bodies. A pattern also matches fixed bodies.
/// Throws `Error` (usage) for an item that matches no body, with the nearest name.
[[nodiscard]] std::vector<BodyId> choose_bodies(const Scene& scene, std::string_view list);

/// Whether a name matches a pattern.
[[nodiscard]] bool matches(const std::string& pattern, const std::string& name) noexcept;

}  // namespace subworld
