#pragma once

#include "lab/page/tables.hpp"
#include "lab/random/judge.hpp"
#include "lab/session/setting.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// Random scenes, in the world and the sub-worlds of each engine and preset.
struct RandomRequest {
  int scenes = 0;
  std::uint64_t seed = 1;
  std::optional<int> only;  ///< this scene alone, with its details
  std::vector<Setting> settings;
  std::string out;
  double most_s = 120.0;  ///< for a scene; one that takes longer counts as a crash
};

/// The engines' presets that are asked for. Throws `Error` (usage).
[[nodiscard]] std::vector<Setting> random_settings(const std::vector<std::string>& engines,
                                                   const std::vector<std::string>& presets);

/// A row for each scene. What fails is made small and kept in `out`/failures. Stops where a signal asks to.
[[nodiscard]] Rows random_rows(const RandomRequest& request);

/// Judges a scene in a process of its own, as `write_scene` keeps it. Where `most_overlap_m` is finite, a scene whose
/// bodies overlap deeper, or that cannot be read, counts as held: it is no smaller one of those that fail. Throws
/// `Interrupted`.
[[nodiscard]] Verdict judged_apart(const Scene& scene, const std::string& folder, double most_s, double most_overlap_m);

}  // namespace subworld
