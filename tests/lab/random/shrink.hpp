#pragma once

#include "model/scene.hpp"

#include <functional>

namespace subworld {

/// Leaves out these bodies (by id, true: out). Tools of users stay.
[[nodiscard]] Scene without_bodies(const Scene& scene, const std::vector<bool>& out);
/// Leaves out one user, and a tool of its own.
[[nodiscard]] Scene without_user(const Scene& scene, std::size_t user);

/// A scene that still fails and has as little in it as can be found within `most_tries`: fewer users and bodies (delta
/// debugging, Zeller and Hildebrandt 2002), plain settings, round numbers. `fails`: the same way as the scene does.
[[nodiscard]] Scene shrunk(Scene scene, const std::function<bool(const Scene&)>& fails, int most_tries = 300);

}  // namespace subworld
