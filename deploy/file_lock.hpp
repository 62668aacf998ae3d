#pragma once

#include <string>

namespace subworld {

/// Holds a file of the temporary folder, or a folder, that only one run of this machine can hold, until this object
/// goes.
class FileLock {
 public:
  FileLock() = default;
  ~FileLock() { release(); }
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;

  /// False where another run holds it, or the folder cannot be written.
  bool take(const std::string& name);
  /// False where another run holds this folder. A file system that knows no locks lets everybody.
  bool take_folder(const std::string& folder);
  void release() noexcept;

 private:
  int file_ = -1;
};

}  // namespace subworld
