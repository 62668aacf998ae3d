#pragma once

#include <stdexcept>
#include <string>

namespace subworld {

/// Exit codes of all programs.
enum class ExitCode : int {
  done = 0,        ///< also after SIGINT and SIGTERM
  failed = 1,      ///< while running
  usage = 2,       ///< error in the command line or the scene
  middleware = 3,  ///< DDS
  quality = 4,     ///< a quality gate was missed
};

/// Thrown at start-up only. The text says where, what was wrong and what would be right. Only `main` catches it.
class Error : public std::runtime_error {
 public:
  Error(ExitCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  [[nodiscard]] ExitCode code() const noexcept { return code_; }

 private:
  ExitCode code_;
};

}  // namespace subworld
