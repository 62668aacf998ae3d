#include "wire/recording_memory.hpp"

#include "model/error.hpp"
#include "wire/topics.hpp"

#include <fmt/core.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>
#include <thread>
#include <utility>

namespace subworld {

namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kHeaderBytes = 4096;
constexpr std::size_t kAlignment = 32;  // of a record, whose header is then never split by the ring's end
constexpr std::size_t kLeastRing = 1U << 16U;
constexpr std::uint64_t kWritten = 1;  // flag beside a record's size
constexpr std::chrono::seconds kLongestWait{10};
constexpr std::chrono::seconds kAbandoned{1};  // a record that takes so long is of a killed program

/// What precedes the bytes of a message. `state`: 0 where no record begins; else the size of the record, plus kWritten
/// once it is whole.
struct RecordHeader {
  std::atomic<std::uint64_t> state;
  std::int64_t time_ns;
  std::uint32_t topic;
  std::uint32_t user;
  std::uint32_t number;
  std::uint32_t bytes;
};
static_assert(sizeof(RecordHeader) == kAlignment);
static_assert(std::atomic<std::uint64_t>::is_always_lock_free);

/// Head and tail count bytes and never wrap. What lies between tail and tail + size, and holds no record, is zero.
struct RingHeader {
  alignas(64) std::atomic<std::uint64_t> head;
  alignas(64) std::atomic<std::uint64_t> tail;
  alignas(64) std::atomic<std::uint64_t> dropped;
  std::array<std::atomic<std::uint64_t>, kTopics.size()> sent;
};
static_assert(sizeof(RingHeader) <= kHeaderBytes);

struct Mapped {
  RingHeader* header = nullptr;
  std::uint8_t* bytes = nullptr;
  std::size_t size = 0;

  [[nodiscard]] RecordHeader& record(std::uint64_t at) const {
    return *std::launder(reinterpret_cast<RecordHeader*>(bytes + (at & (size - 1))));
  }
  /// Calls `use(part of the ring, offset in the message)` for the one or two parts that hold `count` bytes.
  template <class Use>
  void parts(std::uint64_t at, std::size_t count, Use use) const {
    const std::size_t from = at & (size - 1), first = std::min(count, size - from);
    use(std::span(bytes + from, first), std::size_t{0});
    if (first < count) use(std::span(bytes, count - first), first);
  }
};

Mapped map(int file, std::size_t offset, std::size_t size) {
  void* const memory = mmap(nullptr, kHeaderBytes + size, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, file,
                            static_cast<off_t>(offset));
  if (memory == MAP_FAILED) return {};
  return {std::launder(static_cast<RingHeader*>(memory)), static_cast<std::uint8_t*>(memory) + kHeaderBytes, size};
}

Mapped own_memory;
bool own_is_world = false;
std::atomic<bool> recording_ended{false};
std::atomic<std::chrono::seconds> longest_wait{};  // for room in the ring

std::int64_t wall_ns() noexcept {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

/// The recorder may have died: after one wait in vain there is no other.
template <class HasRoom>
bool wait_for_room(HasRoom has_room) noexcept {
  if (has_room()) return true;
  const auto end = Clock::now() + longest_wait.load();
  while (Clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    if (has_room()) return true;
  }
  longest_wait = std::chrono::seconds{0};
  return false;
}

void put(std::size_t topic, std::uint32_t user, std::uint32_t number, std::span<const std::uint8_t> cdr) noexcept {
  RingHeader& ring = *own_memory.header;
  ring.sent[topic].fetch_add(1, std::memory_order_relaxed);
  const std::size_t needed = (sizeof(RecordHeader) + cdr.size() + kAlignment - 1) / kAlignment * kAlignment;
  std::uint64_t head = ring.head.load(std::memory_order_relaxed);
  do {
    if (!wait_for_room([&] { return head + needed - ring.tail.load(std::memory_order_acquire) <= own_memory.size; })) {
      ring.dropped.fetch_add(1, std::memory_order_relaxed);
      return;
    }
  } while (!ring.head.compare_exchange_weak(head, head + needed, std::memory_order_relaxed));
  RecordHeader& record = own_memory.record(head);
  record.state.store(needed, std::memory_order_relaxed);
  record.time_ns = wall_ns();
  record.topic = static_cast<std::uint32_t>(topic);
  record.user = user;
  record.number = number;
  record.bytes = static_cast<std::uint32_t>(cdr.size());
  own_memory.parts(head + sizeof(RecordHeader), cdr.size(), [&](std::span<std::uint8_t> part, std::size_t from) {
    std::ranges::copy(cdr.subspan(from, part.size()), part.begin());
  });
  record.state.store(needed | kWritten, std::memory_order_release);
}

}  // namespace

struct RecordingMemory::Ring {
  std::size_t offset = 0;
  Mapped memory;
  std::uint64_t abandoned = 0;  // messages that a killed program has not written whole
  std::uint64_t waits_at = 0;   // for the record at this tail
  Clock::time_point waits_since = {};

  /// False where there is no further message.
  bool take(RecordedMessage& message, bool last) {
    RingHeader& ring = *memory.header;
    for (;;) {
      const std::uint64_t tail = ring.tail.load(std::memory_order_relaxed);
      if (tail == ring.head.load(std::memory_order_acquire)) return false;
      const RecordHeader& record = memory.record(tail);
      const std::uint64_t state = record.state.load(std::memory_order_acquire);
      const std::uint64_t size = state & ~kWritten;
      if ((state & kWritten) == 0) {
        if (waits_at != tail + 1) waits_since = Clock::now();
        waits_at = tail + 1;
        if (size == 0 || (!last && Clock::now() - waits_since < kAbandoned)) return false;
        ++abandoned;
      } else {
        message.topic = std::min<std::size_t>(record.topic, kTopics.size() - 1);
        message.user = record.user;
        message.number = record.number;
        message.time_ns = record.time_ns;
        message.cdr.resize(record.bytes);
        memory.parts(tail + sizeof(RecordHeader), record.bytes, [&](std::span<std::uint8_t> part, std::size_t from) {
          std::ranges::copy(part, message.cdr.begin() + static_cast<std::ptrdiff_t>(from));
        });
      }
      memory.parts(tail, size,
                   [](std::span<std::uint8_t> part, std::size_t) { std::memset(part.data(), 0, part.size()); });
      ring.tail.store(tail + size, std::memory_order_release);
      if ((state & kWritten) != 0) return true;
    }
  }
};

RecordingMemory::RecordingMemory(const std::vector<std::size_t>& sizes, bool waits)
    : file_(memfd_create("subworld-recording", 0)), waits_(waits) {
  std::size_t end = 0;
  for (const std::size_t size : sizes) {
    Ring& ring = rings_.emplace_back();
    ring.offset = end;
    ring.memory.size = size == 0 ? 0 : std::bit_ceil(std::max(size, kLeastRing));
    if (size > 0) end += kHeaderBytes + ring.memory.size;
  }
  bool made = file_ >= 0 && ftruncate(file_, static_cast<off_t>(end)) == 0;
  for (Ring& ring : rings_) {
    if (!made || ring.memory.size == 0) continue;
    ring.memory = map(file_, ring.offset, ring.memory.size);
    made = ring.memory.header != nullptr;
  }
  if (made) return;
  const int fault = errno;
  if (file_ >= 0) close(file_);
  throw Error(ExitCode::failed,
              fmt::format("--record: no {} MB of memory for the messages on their way to the file: {}", end >> 20U,
                          std::strerror(fault)));
}

RecordingMemory::~RecordingMemory() {
  for (const Ring& ring : rings_) {
    if (ring.memory.header != nullptr) munmap(ring.memory.header, kHeaderBytes + ring.memory.size);
  }
  close(file_);
}

std::string RecordingMemory::place_of(std::size_t program) const {
  if (program >= rings_.size() || rings_[program].memory.size == 0) return {};
  return fmt::format("{}:{}:{}:{}:{:d}", file_, program, rings_[program].offset, rings_[program].memory.size, waits_);
}

void RecordingMemory::take(std::vector<RecordedMessage>& messages, bool last) {
  for (Ring& ring : rings_) {
    if (ring.memory.header == nullptr) continue;
    for (RecordedMessage message; ring.take(message, last); message = {}) messages.push_back(std::move(message));
  }
}

RecordedCounts RecordingMemory::counts() const {
  RecordedCounts all{std::vector<std::uint64_t>(kTopics.size()), 0};
  for (const Ring& ring : rings_) {
    if (ring.memory.header == nullptr) continue;
    for (std::size_t i = 0; i < all.sent.size(); ++i) all.sent[i] += ring.memory.header->sent[i].load();
    all.dropped += ring.memory.header->dropped.load() + ring.abandoned;
  }
  return all;
}

void open_recording() noexcept {
  if (own_memory.header != nullptr) return;
  const char* const text = std::getenv(RecordingMemory::kVariable);
  int file = -1, program = 0, waits = 0;
  std::size_t offset = 0, size = 0;
  struct stat facts {};
  if (text == nullptr || std::sscanf(text, "%d:%d:%zu:%zu:%d", &file, &program, &offset, &size, &waits) != 5 ||
      !std::has_single_bit(size) || fstat(file, &facts) != 0 ||
      static_cast<std::size_t>(facts.st_size) < offset + kHeaderBytes + size)
    return;
  own_memory = map(file, offset, size);
  own_is_world = program == 0;
  longest_wait = waits != 0 ? kLongestWait : std::chrono::seconds{0};
}

bool is_recording() noexcept {
  return own_memory.header != nullptr && !recording_ended.load(std::memory_order_relaxed);
}

void end_recording() noexcept { recording_ended = true; }

std::uint32_t user_of_partition(const std::string& partition) noexcept {
  std::uint32_t user = 0;
  const std::size_t at = partition.rfind('_');
  if (at != std::string::npos) std::from_chars(partition.data() + at + 1, partition.data() + partition.size(), user);
  return user;
}

void record_sent(std::size_t topic, std::uint32_t user, std::uint32_t number,
                 std::span<const std::uint8_t> cdr) noexcept {
  if (is_recording() && topic != kTopicIndex<Control>) put(topic, user, number, cdr);
}

void record_received(std::size_t topic, std::uint32_t number, std::span<const std::uint8_t> cdr) noexcept {
  if (is_recording() && own_is_world && topic == kTopicIndex<Control>) put(topic, 0, number, cdr);
}

}  // namespace subworld
