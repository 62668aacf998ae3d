#pragma once

#include "io/options/options.hpp"

#include <string>

namespace subworld {

/// Locks a file of the temporary folder, or a folder, for one run of this machine and the life of this object.
class FileLock {
 public:
  FileLock() = default;
  ~FileLock();
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

  /// 0, EWOULDBLOCK where another run holds it, or the error number where its file cannot be opened.
  [[nodiscard]] int take(const std::string& name);
  /// False where another run holds this folder. A file system without locks refuses none.
  bool take_folder(const std::string& folder);

 private:
  /// 0, or the error number.
  int lock(const char* path, int flags);
  int file_ = -1;
};

/// In each page of a run that `subworld report` writes: with it, the next run in the folder removes the page.
inline constexpr const char* kReportMark = "Written by Subworld";

/// A domain that no other run on this machine holds while the lock lives: `wanted`, or the first free one where that is
/// negative. Throws `Error` (middleware).
[[nodiscard]] int claim_domain(int wanted, FileLock& lock);

/// Refuses a file of --record or --trace that holds something else than an earlier one: the run would replace it.
/// Throws `Error` (usage).
void check_outputs(const Options& options);

/// Reserves the folder that the user named for this run, and deletes the results of an earlier one; or makes a new one,
/// named after the scene and the time. Throws `Error` (usage, failed).
void claim_folder(std::string& folder, const std::string& scene, FileLock& lock);

/// A run replaces the results in its folder. Throws `Error` (usage) where it goes on from those, or from none.
void check_resume(const Options& options);

}  // namespace subworld
