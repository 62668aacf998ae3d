#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace subworld {

/// The messages of several programs on their way to a recorder. Each program copies what it sends into a ring of its
/// own in shared memory, which takes no system call. A recorder in another process empties the rings. In real time a
/// message that finds its ring full is dropped and counted. In lock-step its program waits.
///
/// Each message is recorded once, by its sender; orders by the world that receives them, because any program may send
/// one.

/// A message in a ring.
struct RecordedMessage {
  std::size_t topic = 0;     ///< row of `kTopicTable`
  std::uint32_t user = 0;    ///< whose topic it is, of topics of one user
  std::uint32_t number = 0;  ///< of its writer: a dropped message leaves a gap
  std::int64_t time_ns = 0;  ///< wall time when it was sent
  std::vector<std::uint8_t> cdr;
};

/// What a program has sent and what of it did not reach the recorder.
struct RecordedCounts {
  std::vector<std::uint64_t> sent;  ///< of each topic
  std::uint64_t dropped = 0;        ///< found the ring full, or were not written whole by a killed program
};

/// The rings of a run's programs. The launcher makes them; programs find theirs by an environment variable.
class RecordingMemory {
 public:
  static constexpr const char* kVariable = "SUBWORLD_RECORDING";

  /// A ring of so many bytes, rounded up to a power of two, for each program; 0: none. `waits`: programs wait for room.
  /// Throws `Error` (failed) where the system refuses the memory.
  RecordingMemory(const std::vector<std::size_t>& sizes, bool waits);
  ~RecordingMemory();
  RecordingMemory(const RecordingMemory&) = delete;
  RecordingMemory& operator=(const RecordingMemory&) = delete;

  /// Value of the variable for a program; empty: it has no ring.
  [[nodiscard]] std::string place_of(std::size_t program) const;
  /// Appends what has arrived, of each program in its order. `last`: the programs have ended.
  void take(std::vector<RecordedMessage>& messages, bool last);
  [[nodiscard]] RecordedCounts counts() const;

 private:
  struct Ring;
  int file_ = -1;
  bool waits_;
  std::vector<Ring> rings_;
};

/// Finds the ring of this process. Call before a loop starts; further calls have no effect.
void open_recording() noexcept;
/// Whether this process has a ring.
[[nodiscard]] bool is_recording() noexcept;
/// What this process sends from now on is not recorded: the recorder may end before it.
void end_recording() noexcept;
/// The user in the name of a partition; 0: it has none.
[[nodiscard]] std::uint32_t user_of_partition(const std::string& partition) noexcept;
/// Puts a message that was sent into the ring. Does not allocate. Any thread.
void record_sent(std::size_t topic, std::uint32_t user, std::uint32_t number,
                 std::span<const std::uint8_t> cdr) noexcept;
/// The same for a message that was received, if it is an order and this program is the world.
void record_received(std::size_t topic, std::uint32_t number, std::span<const std::uint8_t> cdr) noexcept;

}  // namespace subworld
