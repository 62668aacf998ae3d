#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace subworld {

/// The last messages that a program has sent and received, with their main figures: in memory, and after a fault in a
/// file.

/// Number of messages that are kept for each program.
inline constexpr std::size_t kLastMessages = 8192;

/// Memory for the last messages of several programs. The launcher makes it; programs find theirs by an environment
/// variable. It outlives a program that is killed, and ends with the last process that has it open.
class MessageMemory {
 public:
  static constexpr const char* kVariable = "SUBWORLD_LAST_MESSAGES";

  /// Where the system refuses it, nothing is kept.
  explicit MessageMemory(int programs);
  ~MessageMemory();
  MessageMemory(const MessageMemory&) = delete;
  MessageMemory& operator=(const MessageMemory&) = delete;

  /// Value of the variable for a program, 0 .. programs - 1.
  [[nodiscard]] std::string place_of(int program) const;
  /// Writes the messages of a program as a table, the oldest first. No file where it has none. Returns what went wrong;
  /// empty: nothing.
  [[nodiscard]] std::string write(int program, const std::string& path) const;

 private:
  int programs_;
  int file_ = -1;
};

/// Gets the memory of this process: that of the launcher, or its own. Call before a loop starts; further calls have no
/// effect.
void keep_last_messages() noexcept;

/// Keeps a message of this process, `sample` of the model struct of the topic. Does not block or allocate.
void keep_message(std::size_t topic, bool sent, std::size_t bytes, const void* sample) noexcept;

/// Writes the messages of this process as a table, unless a launcher does that.
void write_last_messages(const std::string& path) noexcept;

}  // namespace subworld
