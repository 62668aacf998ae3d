#include "wire/message_memory.hpp"

#include "model/error.hpp"
#include "wire/topics.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>
#include <optional>
#include <thread>
#include <utility>

namespace subworld {

namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kHeaderBytes = 4096;
constexpr std::size_t kAlignment = 32;  // of a record, whose header is then never split by the ring's end
constexpr std::size_t kLeastRing = 1U << 16U, kOwnRing = 1U << 20U;
/// The figures of all messages are in their first bytes. With the header, a record of 320 bytes at most.
constexpr std::size_t kKeptBytes = 288;
constexpr std::uint64_t kMark = 0x9e3779b97f4a7c15;
constexpr std::chrono::seconds kLongestWait{10};
constexpr std::chrono::seconds kAbandoned{1};  // a record that takes so long is of a killed program

/// What precedes the bytes of a message. `begin`: its place in the ring, with kMark, once it is whole. No other bytes
/// are likely to be equal, so that a reader finds the next record from anywhere.
struct Record {
  std::atomic<std::uint64_t> begin;
  MessageFacts facts;

  /// Of a message, with its bytes.
  [[nodiscard]] static std::size_t room(std::size_t bytes) {
    return (sizeof(Record) + bytes + kAlignment - 1) / kAlignment * kAlignment;
  }
};
static_assert(sizeof(Record) == kAlignment);
static_assert(std::atomic<std::uint64_t>::is_always_lock_free);

std::size_t kept_bytes(const MessageFacts& facts) {
  return facts.recorded ? facts.bytes : std::min<std::size_t>(facts.bytes, kKeptBytes);
}

/// Head and tail count bytes and never wrap. The tail is the recorder's.
struct RingHeader {
  alignas(64) std::atomic<std::uint64_t> head;
  alignas(64) std::atomic<std::uint64_t> tail;
  alignas(64) std::atomic<std::uint64_t> sent;
};
static_assert(sizeof(RingHeader) <= kHeaderBytes);

struct Mapped {
  RingHeader* header = nullptr;
  std::uint8_t* bytes = nullptr;
  std::size_t size = 0;

  [[nodiscard]] Record& record(std::uint64_t at) const {
    return *std::launder(reinterpret_cast<Record*>(bytes + (at & (size - 1))));
  }
  /// Calls `use(part of the ring, offset in the message)` for the one or two parts that hold `count` bytes.
  template <class Use>
  void parts(std::uint64_t at, std::size_t count, Use use) const {
    const std::size_t from = at & (size - 1), first = std::min(count, size - from);
    use(std::span(bytes + from, first), std::size_t{0});
    if (first < count) use(std::span(bytes, count - first), first);
  }

  /// The whole message that begins there; none: there is none, or it was overwritten.
  [[nodiscard]] std::optional<KeptMessage> read(std::uint64_t at) const {
    const Record& kept = record(at);
    if (kept.begin.load(std::memory_order_acquire) != (at ^ kMark)) return {};
    KeptMessage message{kept.facts, {}};
    const std::size_t count = kept_bytes(message);
    if (message.topic >= kTopics.size() || Record::room(count) > size) return {};
    message.cdr.resize(count);
    parts(at + sizeof(Record), count, [&](std::span<std::uint8_t> part, std::size_t from) {
      std::ranges::copy(part, message.cdr.begin() + static_cast<std::ptrdiff_t>(from));
    });
    std::atomic_thread_fence(std::memory_order_acquire);
    if (header->head.load(std::memory_order_relaxed) - at > size) return {};
    return message;
  }

  [[nodiscard]] std::vector<KeptMessage> all() const {
    std::vector<KeptMessage> messages;
    const std::uint64_t head = header->head.load(std::memory_order_acquire);
    for (std::uint64_t at = head > size ? head - size : 0; at < head;) {
      auto message = read(at);
      at += message ? Record::room(message->cdr.size()) : kAlignment;
      if (message) messages.push_back(*std::move(message));
    }
    return messages;
  }
};

/// Memory that is zero at first, which is an empty ring.
Mapped map(int file, std::size_t offset, std::size_t size) {
  const int flags = (file < 0 ? MAP_PRIVATE | MAP_ANONYMOUS : MAP_SHARED) | MAP_POPULATE;
  void* const memory =
      mmap(nullptr, kHeaderBytes + size, PROT_READ | PROT_WRITE, flags, file, static_cast<off_t>(offset));
  if (memory == MAP_FAILED) return {};
  return {std::launder(static_cast<RingHeader*>(memory)), static_cast<std::uint8_t*>(memory) + kHeaderBytes, size};
}

/// The ring of this process.
struct OwnRing : Mapped {
  int recorded = 0, waits = 0, of_world = 0, own = 1;

  /// The launcher's memory, or its own.
  OwnRing() {
    const char* const text = std::getenv(MessageMemory::kVariable);
    int file = -1;
    std::size_t offset = 0, wanted = 0;
    struct stat facts {};
    if (text != nullptr &&
        std::sscanf(text, "%d:%zu:%zu:%d:%d:%d:%d", &file, &offset, &wanted, &recorded, &waits, &of_world, &own) == 7 &&
        std::has_single_bit(wanted) && fstat(file, &facts) == 0 &&
        static_cast<std::size_t>(facts.st_size) >= offset + kHeaderBytes + wanted)
      static_cast<Mapped&>(*this) = map(file, offset, wanted);
    if (header != nullptr) return;
    recorded = waits = 0;
    own = 1;
    static_cast<Mapped&>(*this) = map(-1, 0, kOwnRing);
  }
};
const OwnRing* own_ring = nullptr;
std::atomic<bool> recording_ended{false};
std::atomic<std::chrono::seconds> longest_wait{kLongestWait};  // for room in the ring

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

/// The place of a record; none: the recorder leaves no room.
std::optional<std::uint64_t> reserve(const OwnRing& ring, std::size_t room) noexcept {
  std::atomic<std::uint64_t>& next = ring.header->head;
  if (ring.waits == 0 || !is_recording()) return next.fetch_add(room, std::memory_order_relaxed);
  std::uint64_t head = next.load(std::memory_order_relaxed);
  do {
    if (!wait_for_room([&] { return head + room - ring.header->tail.load(std::memory_order_acquire) <= ring.size; }))
      return {};
  } while (!next.compare_exchange_weak(head, head + room, std::memory_order_relaxed));
  return head;
}

template <class Model>
std::uint32_t bodies_in(const void* sample) noexcept {
  const auto& message = *static_cast<const Model*>(sample);
  if constexpr (requires { message.members; }) return static_cast<std::uint32_t>(message.members.size());
  if constexpr (requires { message.bodies; }) return static_cast<std::uint32_t>(message.bodies.size());
  if constexpr (requires { message.moved; }) return static_cast<std::uint32_t>(message.moved.size());
  return kNoBodies;
}
constexpr std::array kBodies =
    std::apply([]<class... Models>(const Topic<Models>&...) { return std::array{&bodies_in<Models>...}; }, kTopicTable);

}  // namespace

struct MessageMemory::Ring {
  std::size_t offset = 0;
  Mapped memory = {};
  std::uint64_t waits_at = 0;  // for the record at this tail
  Clock::time_point waits_since = {};

  bool is_abandoned(std::uint64_t at) {
    if (waits_at != at + 1) waits_since = Clock::now();
    waits_at = at + 1;
    return Clock::now() - waits_since > kAbandoned;
  }

  void take(std::vector<KeptMessage>& messages, bool last) {
    const RingHeader& ring = *memory.header;
    bool skips = last;
    for (std::uint64_t at = ring.tail, head = ring.head; at != head; head = ring.head) {
      const bool overrun = head - at > memory.size;
      if (overrun) at = head - memory.size / 2;
      auto message = memory.read(at);
      skips = !message && (skips || overrun || is_abandoned(at));
      if (!message && !skips) return;
      at += message ? Record::room(message->cdr.size()) : kAlignment;
      if (message && message->recorded) messages.push_back(*std::move(message));
      skips |= last;
      memory.header->tail.store(at, std::memory_order_release);
    }
  }
};

MessageMemory::MessageMemory(const std::vector<std::size_t>& sizes, Config config)
    : config_(config), file_(memfd_create("subworld-messages", 0)) {
  std::size_t end = 0;
  for (const std::size_t size : sizes) {
    Ring& ring = rings_.emplace_back();
    ring.offset = end;
    ring.memory.size = size == 0 ? 0 : std::bit_ceil(std::max(size, kLeastRing));
    if (size > 0) end += kHeaderBytes + ring.memory.size;
  }
  // A page that the system could not provide later would end the program that uses it.
  int fault = file_ < 0 ? errno : posix_fallocate(file_, 0, static_cast<off_t>(end));
  for (Ring& ring : rings_) {
    if (fault != 0 || ring.memory.size == 0) continue;
    ring.memory = map(file_, ring.offset, ring.memory.size);
    if (ring.memory.header == nullptr) fault = errno;
  }
  if (fault == 0) return;
  if (file_ >= 0) close(file_);
  file_ = -1;
  rings_.clear();
  if (!config.recorded) return;
  throw Error(ExitCode::failed,
              fmt::format("--record: no {} MB of memory for the messages on their way to the file: {}", end >> 20U,
                          std::strerror(fault)));
}

MessageMemory::~MessageMemory() {
  for (const Ring& ring : rings_) {
    if (ring.memory.header != nullptr) munmap(ring.memory.header, kHeaderBytes + ring.memory.size);
  }
  if (file_ >= 0) close(file_);
}

std::string MessageMemory::place_of(std::size_t program) const {
  if (program >= rings_.size() || rings_[program].memory.size == 0) return {};
  return fmt::format("{}:{}:{}:{:d}:{:d}:{:d}:{:d}", file_, rings_[program].offset, rings_[program].memory.size,
                     config_.recorded, config_.waits, program == 0, config_.keeps_to_itself);
}

void MessageMemory::take(std::vector<KeptMessage>& messages, bool last) {
  for (Ring& ring : rings_) {
    if (ring.memory.header != nullptr) ring.take(messages, last);
  }
}

std::uint64_t MessageMemory::sent() const {
  std::uint64_t all = 0;
  for (const Ring& ring : rings_) all += ring.memory.header == nullptr ? 0 : ring.memory.header->sent.load();
  return all;
}

std::vector<KeptMessage> MessageMemory::last_of(std::size_t program) const {
  return place_of(program).empty() ? std::vector<KeptMessage>{} : rings_[program].memory.all();
}

void open_messages() noexcept {
  static const OwnRing ring;
  if (ring.header != nullptr) own_ring = &ring;
}

bool is_recording() noexcept {
  return own_ring != nullptr && own_ring->recorded != 0 && !recording_ended.load(std::memory_order_relaxed);
}

void end_recording() noexcept { recording_ended = true; }

std::uint16_t user_of_partition(const std::string& partition) noexcept {
  std::uint16_t user = 0;
  const std::size_t at = partition.rfind('_');
  if (at != std::string::npos) std::from_chars(partition.data() + at + 1, partition.data() + partition.size(), user);
  return user;
}

void keep_message(MessageFacts facts, const void* sample, std::span<const std::uint8_t> cdr) noexcept {
  if (own_ring == nullptr) return;
  const OwnRing& ring = *own_ring;
  facts.time_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now().time_since_epoch()).count();
  facts.bytes = static_cast<std::uint32_t>(cdr.size());
  facts.bodies = kBodies[facts.topic](sample);
  if (is_recording() && (facts.topic == kTopicIndex<Control> ? !facts.sent && ring.of_world != 0 : facts.sent)) {
    ring.header->sent.fetch_add(1, std::memory_order_relaxed);
    facts.recorded = Record::room(cdr.size()) <= ring.size;
  }
  cdr = cdr.first(kept_bytes(facts));
  const std::optional<std::uint64_t> at = reserve(ring, Record::room(cdr.size()));
  if (!at) return;
  Record& record = ring.record(*at);
  record.begin.store(0, std::memory_order_relaxed);
  std::atomic_thread_fence(std::memory_order_release);
  record.facts = facts;
  ring.parts(*at + sizeof(Record), cdr.size(), [&](std::span<std::uint8_t> part, std::size_t from) {
    std::ranges::copy(cdr.subspan(from, part.size()), part.begin());
  });
  record.begin.store(*at ^ kMark, std::memory_order_release);
}

std::vector<KeptMessage> own_messages() {
  return own_ring == nullptr || own_ring->own == 0 ? std::vector<KeptMessage>{} : own_ring->all();
}

}  // namespace subworld
