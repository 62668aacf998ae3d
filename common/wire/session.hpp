#pragma once

#include "model/exchange.hpp"
#include "wire/bus.hpp"

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

namespace subworld {

/// A random number that identifies a process, also among restarts of the same program. Never 0.
[[nodiscard]] std::uint64_t draw_identity();

/// For example "haptic_sim 0" or "world_sim".
[[nodiscard]] std::string label_of(ProgramKind program, std::uint32_t instance);

/// Error text for a peer without a sign of life: "haptic_sim 0 has died or is suspended".
[[nodiscard]] std::string gone_text(ProgramKind program, std::uint32_t instance);
/// Error text for a peer that belongs to another run, or was restarted.
[[nodiscard]] std::string replaced_text(ProgramKind program, std::uint32_t instance);

/// Finds the session of the world in whose run a program takes part, from topic `scene`.
class SessionFinder {
 public:
  /// `settings_hash`: of the program's scene file and flags.
  SessionFinder(Reader<SceneDescription>& scene, std::uint64_t settings_hash)
      : scene_(&scene), settings_hash_(settings_hash) {}

  /// Takes all available samples; true once a world with the same settings is known. The newest one counts. Throws
  /// `Error` (usage) if a world has other settings, once it can no longer be an earlier run that is ending.
  bool look(const std::string& scene_file, int domain);
  [[nodiscard]] std::uint64_t session() const noexcept { return session_; }

 private:
  Reader<SceneDescription>* scene_;
  std::uint64_t settings_hash_;
  std::uint64_t session_ = 0;
  SceneDescription description_;
  std::optional<std::chrono::steady_clock::time_point> other_;  ///< when a world with other settings was first seen
};

}  // namespace subworld
