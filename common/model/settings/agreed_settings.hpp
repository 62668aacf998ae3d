#pragma once

#include "model/scene/scene.hpp"

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace subworld {

/// A setting by its name in the scene file, as text: {"settings.ratio", "4"}.
struct NamedSetting {
  std::string name;
  std::string value;
  bool operator==(const NamedSetting&) const = default;
};

/// All that programs must share to take part in one run: settings but the duration, users, and all meshes, bodies and
/// initial states as the hash `bodies`. Numbers read back as the same numbers.
[[nodiscard]] std::vector<NamedSetting> agreed_settings(const Scene& scene);

/// Properties of a body that a `SceneDescription` carries too.
[[nodiscard]] std::vector<NamedSetting> settings_of(const Body& body);

/// How settings differ from the world's, for an error text: "settings.ratio is 8, in the world 4"; empty: not at all.
/// Of several differences the first `named` are named. `where` the others are.
[[nodiscard]] std::string difference(std::span<const NamedSetting> own, std::span<const NamedSetting> world,
                                     std::size_t named = 3, const char* where = "in the world");

/// Hash of agreed_settings(). FNV-1a of 64 bits, equal on every machine.
[[nodiscard]] std::uint64_t settings_hash(const Scene& scene);

}  // namespace subworld
