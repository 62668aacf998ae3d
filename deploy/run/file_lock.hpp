#pragma once

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

}  // namespace subworld
