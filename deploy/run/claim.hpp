#pragma once

#include "io/options.hpp"
#include "run/file_lock.hpp"

#include <string>

namespace subworld {

/// In each page of a run that `subworld report` writes: with it, the next run in the folder removes the page.
inline constexpr const char* kReportMark = "Written by Subworld";

/// A domain that no other run on this machine holds while the lock lives: `wanted`, or the first free one where that is
/// negative. Throws `Error` (middleware).
[[nodiscard]] int claim_domain(int wanted, FileLock& lock);

/// Reserves the folder that the user named for this run, and deletes the results of an earlier one; or makes a new one,
/// named after the scene and the time. Throws `Error` (usage, failed).
void claim_folder(std::string& folder, const std::string& scene, FileLock& lock);

/// A run replaces the results in its folder. Throws `Error` (usage) where it goes on from those, or from none.
void check_resume(const Options& options);

}  // namespace subworld
