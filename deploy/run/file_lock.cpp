#include "run/file_lock.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>

namespace subworld {

FileLock::~FileLock() {
  if (file_ >= 0) close(file_);
}

int FileLock::take(const std::string& name) {
  const auto path = std::filesystem::temp_directory_path() / (name + ".lock");
  // A lock needs no right to write. The file may be another user's, and the kernel then refuses to open it with
  // O_CREAT in a shared folder (fs.protected_regular).
  const int error = lock(path.c_str(), O_RDONLY);
  return error == ENOENT ? lock(path.c_str(), O_RDONLY | O_CREAT) : error;
}

bool FileLock::take_folder(const std::string& folder) {
  return lock(folder.c_str(), O_RDONLY | O_DIRECTORY) != EWOULDBLOCK;
}

int FileLock::lock(const char* path, int flags) {
  if (file_ >= 0) close(file_);
  file_ = open(path, flags | O_CLOEXEC, 0644);
  return file_ >= 0 && flock(file_, LOCK_EX | LOCK_NB) == 0 ? 0 : errno;
}

}  // namespace subworld
