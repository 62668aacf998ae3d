#pragma once

#include <sys/types.h>

#include <optional>
#include <string>

namespace subworld {

/// A shell command that answers lines. The destructor ends it.
class Dialogue {
 public:
  explicit Dialogue(const std::string& command);
  ~Dialogue();
  Dialogue(const Dialogue&) = delete;
  Dialogue& operator=(const Dialogue&) = delete;

  /// Sends an empty line. False where the command has ended.
  [[nodiscard]] bool ask() const;
  /// Its next line; nothing where none comes within ten seconds.
  [[nodiscard]] std::optional<std::string> answer() const;
  /// Closes its input, and waits until it has ended, at most as long.
  void end() const;

 private:
  pid_t child_ = -1;
  int end_ = -1;
};

}  // namespace subworld
