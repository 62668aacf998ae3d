#pragma once

#include "model/scene/scene.hpp"

#include <functional>

namespace subworld {

/// Removes these bodies (by id; true: removed). Users' tools stay.
[[nodiscard]] Scene without_bodies(const Scene& scene, const std::vector<bool>& out);
/// Removes one user, with a tool of its own.
[[nodiscard]] Scene without_user(const Scene& scene, std::size_t user);

/// A scene that still fails and is as small as can be found within `most_tries`: fewer users and bodies (delta
/// debugging, Zeller and Hildebrandt 2002), plain settings, round numbers. `fails`: whether a scene fails in the same
/// way.
[[nodiscard]] Scene shrunk(Scene scene, const std::function<bool(const Scene&)>& fails, int most_tries = 300);

}  // namespace subworld
