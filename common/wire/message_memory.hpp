#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace subworld {

/// The messages that a program sends and receives, in a ring in memory. The newest one takes the place of the oldest.
/// The launcher shares the memory: a recorder takes the recorded messages as they come, and after a fault the last
/// messages of each program are written to a file (wire/last_messages).
///
/// Each message is recorded once, by its sender; orders by the world that receives them, because any program may send
/// one. A recorded message is kept whole, and of any other its beginning. In real time a recorder that is too slow
/// loses messages. In lock-step a program that is recorded waits for it.

inline constexpr std::uint32_t kNoBodies = ~std::uint32_t{0};

/// What is known of a message without its bytes.
struct MessageFacts {
  std::int64_t time_ns = 0;          ///< steady clock
  std::uint32_t number = 0;          ///< of its writer: a lost message leaves a gap
  std::uint32_t bytes = 0;           ///< of the whole message
  std::uint32_t bodies = kNoBodies;  ///< that it lists
  std::uint16_t user = 0;            ///< of a message that was sent: whose topic it is, of topics of one user
  std::uint8_t topic = 0;            ///< row of `kTopicTable`
  bool sent : 1 = false;
  bool recorded : 1 = false;
};
struct KeptMessage : MessageFacts {
  std::vector<std::uint8_t> cdr;  ///< with its header
};

/// The rings of a run's programs. Programs find theirs by an environment variable. The memory outlives a program that
/// is killed, and ends with the last process that has it open.
class MessageMemory {
 public:
  static constexpr const char* kVariable = "SUBWORLD_MESSAGES";

  struct Config {
    bool recorded = false;
    bool waits = false;            ///< for the recorder
    bool keeps_to_itself = false;  ///< after a fault, programs write their last messages themselves
  };
  /// A ring of so many bytes, rounded up to a power of two, for each program, the world first; 0: none. Where the
  /// system refuses the memory there is none, and programs have their own; of a recording throws `Error` (failed).
  MessageMemory(const std::vector<std::size_t>& sizes, Config config);
  ~MessageMemory();
  MessageMemory(const MessageMemory&) = delete;
  MessageMemory& operator=(const MessageMemory&) = delete;

  /// Value of the variable for a program; empty: it has no ring.
  [[nodiscard]] std::string place_of(std::size_t program) const;
  /// Appends the recorded messages that have arrived, of each program in its order. `last`: the programs have ended.
  void take(std::vector<KeptMessage>& messages, bool last);
  /// Number of messages to record, also of those that were lost.
  [[nodiscard]] std::uint64_t sent() const;
  /// The messages in the ring of a program, the oldest first.
  [[nodiscard]] std::vector<KeptMessage> last_of(std::size_t program) const;

 private:
  struct Ring;
  Config config_;
  int file_ = -1;
  std::vector<Ring> rings_;
};

/// Finds the ring of this process, or makes its own. Call before a loop starts; further calls have no effect.
void open_messages() noexcept;
/// Whether what this process sends is recorded.
[[nodiscard]] bool is_recording() noexcept;
/// What this process sends from now on is not recorded: the recorder may end before it.
void end_recording() noexcept;
/// The user in the name of a partition; 0: it has none.
[[nodiscard]] std::uint16_t user_of_partition(const std::string& partition) noexcept;
/// Puts a message into the ring; `sample` is its model struct. Does not allocate, and does not wait in real time. Any
/// thread. Of `facts` the topic, the user, the number and the direction are known.
void keep_message(MessageFacts facts, const void* sample, std::span<const std::uint8_t> cdr) noexcept;
/// The messages of this process, the oldest first; none where a launcher reads them.
[[nodiscard]] std::vector<KeptMessage> own_messages();

}  // namespace subworld
