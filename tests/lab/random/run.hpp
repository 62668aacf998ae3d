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
  std::optional<int> only;  ///< only this scene, with its details
  std::vector<EngineSetting> settings;
  std::string out;
  double most_s = 120.0;  ///< for a scene; a longer run counts as a crash
};

/// The requested engines and presets. Throws `Error` (usage).
[[nodiscard]] std::vector<EngineSetting> random_settings(const std::vector<std::string>& engines,
                                                         const std::vector<std::string>& presets);

/// One row for each scene. Failing scenes are shrunk and saved in `out`/failures. Stops if a signal requests it.
[[nodiscard]] Rows random_rows(const RandomRequest& request);

/// Judges a scene in a child process, in the form in which `write_scene` saves it. If `most_overlap_m` is finite, a
/// scene with a deeper overlap, or one that cannot be read, counts as held: it is not a smaller version of the failing
/// scene. Throws `Interrupted`.
[[nodiscard]] Verdict judged_apart(const Scene& scene, const std::string& folder, double most_s, double most_overlap_m);

}  // namespace subworld
