#pragma once

#include "model/exchange.hpp"
#include "wire/bus.hpp"

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

namespace subworld {

/// A number that tells a process from all others, also from one that was started again in its place. Never 0.
[[nodiscard]] std::uint64_t draw_identity();

/// "haptic_sim 0"; "world_sim".
[[nodiscard]] std::string label_of(ProgramKind program, std::uint32_t instance);

/// "haptic_sim 0 has died or is halted".
[[nodiscard]] std::string gone_text(ProgramKind program, std::uint32_t instance);
/// What is of another run, or of a program that was started again.
[[nodiscard]] std::string replaced_text(ProgramKind program, std::uint32_t instance);

/// The session of the world that a program takes part in, from topic `scene`.
class SessionFinder {
 public:
  /// `settings_hash`: of the scene file and flags that the program was given.
  SessionFinder(Reader<SceneDescription>& scene, std::uint64_t settings_hash)
      : scene_(&scene), settings_hash_(settings_hash) {}

  /// Takes what there is; true once a world with the same settings is known. The newest one counts. Throws `Error`
  /// (usage) where a world has other settings, once it can no longer be one of another run that ends just now.
  bool look(const std::string& scene_file, int domain);
  [[nodiscard]] std::uint64_t session() const noexcept { return session_; }

 private:
  Reader<SceneDescription>* scene_;
  std::uint64_t settings_hash_;
  std::uint64_t session_ = 0;
  SceneDescription description_;
  std::optional<std::chrono::steady_clock::time_point> other_;  ///< when a world with other settings was first heard
};

}  // namespace subworld
