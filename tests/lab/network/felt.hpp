#pragma once

#include "lab/coupling/measure.hpp"
#include "lab/network/cell.hpp"
#include "lab/page/tables.hpp"

#include <optional>
#include <string>
#include <vector>

/// What users feel over a link: the real programs run a scene in real time over it, and the force on each operator is
/// compared with that of a reference of the same motions (lab/over_link).
namespace subworld {

struct FeltSettings {
  std::string scene;  ///< a file, or a name in deploy/scenes; empty: nothing is run
  std::optional<double> duration_s = {};
  int domain = 90;
};

/// One run: which vendors, over which link.
struct FeltCell {
  std::string world_dds = "fastdds";
  std::string haptic_dds = "fastdds";
  std::string link = "ideal";
};

/// The runs in their order: the vendor pairs of a link directly after each other. None without a scene.
[[nodiscard]] std::vector<FeltCell> felt_cells_of(const NetworkAxes& axes, const FeltSettings& settings);

/// Throws `Error` (usage) where the scene cannot be read.
void check_scene(const FeltSettings& settings);

/// A row for each user, also where the run failed: then with the reason. Empty if a signal requested a stop.
[[nodiscard]] Rows measure_felt(const FeltCell& cell, const FeltSettings& settings, References& references);

/// A row without values.
[[nodiscard]] Json felt_row_of(const FeltCell& cell, const FeltSettings& settings);
[[nodiscard]] std::string command_of(const FeltCell& cell, const FeltSettings& settings);
/// Usual length of a run, s.
[[nodiscard]] double planned_s(const FeltCell& cell, const FeltSettings& settings);

/// For the progress.
[[nodiscard]] std::string to_text(const FeltCell& cell, const FeltSettings& settings);
/// For the progress: the figures of the user with the largest error, or the failure.
[[nodiscard]] std::string felt_result_text(const Rows& users);

/// Whether the programs were late by themselves, whatever the link: a missed gate of deadlines or of the world's clock.
[[nodiscard]] bool disturbed(const Json& row);
/// Over which links the error of the felt force is within the imperceptible bar, in one sentence. Empty without rows.
[[nodiscard]] std::string felt_sentence_of(const Rows& rows);

}  // namespace subworld
