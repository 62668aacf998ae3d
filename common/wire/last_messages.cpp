#include "wire/last_messages.hpp"

#include "wire/changes.hpp"
#include "wire/topics.hpp"

#include <fmt/core.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <new>
#include <string_view>
#include <utility>
#include <vector>

namespace subworld {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// What is kept of a message. A figure that its topic does not have is not a number.
struct Kept {
  std::int64_t at_ns = 0;
  std::uint64_t number = 0;
  double stamp_s = kNone;
  std::array<double, 3> position_m{kNone, kNone, kNone};
  std::array<double, 3> force_n{kNone, kNone, kNone};
  double bodies = kNone;
  std::uint32_t user = 0;
  std::uint32_t bytes = 0;
  std::uint8_t topic = 0;
  bool sent = false;
  std::array<char, 14> state{};
};

std::array<double, 3> three(const Vec3& v) { return {v.x(), v.y(), v.z()}; }

void name(Kept& kept, std::string_view text) {
  kept.state = {};
  std::copy_n(text.begin(), std::min(text.size(), kept.state.size() - 1), kept.state.begin());
}

const Changes kNoChanges;

/// The archive that picks the main figures of a message from its fields.
struct Figures {
  Kept& kept;
  const Changes& changes = kNoChanges;

  bool operator()(std::string_view field, const auto& value) {
    using T = std::remove_cvref_t<decltype(value)>;
    if constexpr (requires { name_of(value); }) {
      name(kept, name_of(value));
    } else if constexpr (std::is_integral_v<T> || std::is_enum_v<T>) {
      number(field, static_cast<std::uint64_t>(value));
    } else if constexpr (std::is_floating_point_v<T>) {
      if (is(field, {"stamp_s", "time_s"})) kept.stamp_s = value;
    } else if constexpr (std::same_as<T, std::string>) {
      if (is(field, {"name", "state"})) name(kept, value);
    } else if constexpr (std::same_as<T, Pose> || std::same_as<T, BodyState>) {
      kept.position_m = three(value.position);
    } else if constexpr (std::same_as<T, Wrench>) {
      if (is(field, {"applied", "wrench"})) kept.force_n = three(value.force);
    } else if constexpr (requires { value.size(); }) {
      if (is(field, {"bodies", "members", "moved"})) kept.bodies = static_cast<double>(value.size());
    }
    return true;
  }
  bool operator()(std::string_view field, const auto& value, const auto&) { return (*this)(field, value); }
  bool sequence(std::string_view, const auto&, const auto&) { return true; }
  bool check(bool) { return true; }

 private:
  [[gnu::noinline]] static bool is(std::string_view field, std::initializer_list<std::string_view> names) {
    return std::ranges::find(names, field) != names.end();
  }
  [[gnu::noinline]] void number(std::string_view field, std::uint64_t value) {
    if (is(field, {"user", "device", "instance"})) kept.user = static_cast<std::uint32_t>(value);
    if (is(field, {"number", "sequence_number", "stamp", "steps"})) kept.number = value;
    if (field == "served" && value == 0 && kept.topic == kTopicIndex<WorldFrame>) name(kept, "complete");
    if (field == "last" && value != 0) name(kept, "last");
  }
};

using Fill = void (*)(Kept&, const void*);
constexpr std::array kFills = std::apply(
    []<class... Models>(const Topic<Models>&...) {
      return std::array<Fill, sizeof...(Models)>{[](Kept& kept, const void* sample) {
        Figures archive{kept};
        fields(archive, *static_cast<const Models*>(sample));
      }...};
    },
    kTopicTable);

/// `number` is 0 while the row is written, else one more than the number of messages before it.
struct Row {
  std::atomic<std::uint64_t> number;
  Kept kept;
};
struct Ring {
  std::atomic<std::uint64_t> count;
  std::array<Row, kLastMessages> rows;
};
static_assert(std::atomic<std::uint64_t>::is_always_lock_free);

constexpr std::size_t kPage = 4096;
constexpr std::size_t kRoom = (sizeof(Ring) + kPage - 1) / kPage * kPage;  ///< of a program

/// Memory that is zero at first, which is an empty ring.
Ring* map(int file, int place, bool fill) {
  const int flags = (file < 0 ? MAP_PRIVATE | MAP_ANONYMOUS : MAP_SHARED) | (fill ? MAP_POPULATE : 0);
  void* const memory = mmap(nullptr, kRoom, PROT_READ | PROT_WRITE, flags, file,
                            static_cast<off_t>(kRoom) * static_cast<off_t>(std::max(place, 0)));
  return memory == MAP_FAILED ? nullptr : std::launder(static_cast<Ring*>(memory));
}

std::atomic<Ring*> own{nullptr};
bool launcher_writes = false;

std::string cell(double value) { return std::isfinite(value) ? fmt::format(",{:.9g}", value) : ","; }

std::string write_ring(const Ring& ring, const std::string& path) {
  std::vector<const Row*> rows;
  for (const Row& row : ring.rows) {
    if (row.number.load(std::memory_order_acquire) != 0) rows.push_back(&row);
  }
  if (rows.empty()) return {};
  // Several threads send: who has taken a place first may have read the clock later.
  std::ranges::sort(
      rows, {}, [](const Row* row) { return std::pair(row->kept.at_ns, row->number.load(std::memory_order_relaxed)); });
  std::string text =
      "time_s,direction,topic,user,number,stamp_s,bytes,x_m,y_m,z_m,force_x_n,force_y_n,force_z_n,bodies,state\n";
  for (const Row* row : rows) {
    const Kept& kept = row->kept;
    text += fmt::format("{:.6f},{},{},{},{}", 1e-9 * static_cast<double>(kept.at_ns), kept.sent ? "sent" : "received",
                        kTopics[kept.topic % kTopics.size()].name, kept.user, kept.number);
    text += cell(kept.stamp_s) + fmt::format(",{}", kept.bytes);
    for (const double value : kept.position_m) text += cell(value);
    for (const double value : kept.force_n) text += cell(value);
    text +=
        cell(kept.bodies) + "," + std::string(kept.state.data(), strnlen(kept.state.data(), kept.state.size())) + "\n";
  }
  std::ofstream file(path);
  file << text;
  file.close();
  if (file) return {};
  const std::string fault = fmt::format("{}: {}", path, std::strerror(errno));
  std::remove(path.c_str());
  return fault;
}

/// The launcher's memory, and the place of this program there.
Ring* from_launcher() noexcept {
  const char* const text = std::getenv(MessageMemory::kVariable);
  int file = -1, place = -1;
  struct stat facts {};
  if (text == nullptr || std::sscanf(text, "%d:%d", &file, &place) != 2 || file < 0 || place < 0) return nullptr;
  if (fstat(file, &facts) != 0 || facts.st_size < static_cast<off_t>(kRoom) * (place + 1)) return nullptr;
  return map(file, place, true);
}

}  // namespace

MessageMemory::MessageMemory(int programs) : programs_(programs), file_(memfd_create("subworld-last-messages", 0)) {
  if (file_ >= 0 && ftruncate(file_, static_cast<off_t>(kRoom) * programs) == 0) return;
  if (file_ >= 0) close(file_);
  file_ = -1;
}

MessageMemory::~MessageMemory() {
  if (file_ >= 0) close(file_);
}

std::string MessageMemory::place_of(int program) const {
  return file_ < 0 || program >= programs_ ? "" : fmt::format("{}:{}", file_, program);
}

std::string MessageMemory::write(int program, const std::string& path) const {
  if (place_of(program).empty()) return {};
  Ring* const ring = map(file_, program, false);
  if (ring == nullptr) return std::strerror(errno);
  std::string fault = write_ring(*ring, path);
  munmap(ring, kRoom);
  return fault;
}

void keep_last_messages() noexcept {
  if (own.load() != nullptr) return;
  Ring* ring = from_launcher();
  launcher_writes = ring != nullptr;
  if (ring == nullptr) ring = map(-1, 0, true);
  Ring* none = nullptr;
  if (ring != nullptr && !own.compare_exchange_strong(none, ring)) munmap(ring, kRoom);
}

void keep_message(std::size_t topic, bool sent, std::size_t bytes, const void* sample) noexcept {
  Ring* const ring = own.load(std::memory_order_relaxed);
  if (ring == nullptr) return;
  const std::uint64_t before = ring->count.fetch_add(1, std::memory_order_relaxed);
  Row& row = ring->rows[before % kLastMessages];
  row.number.store(0, std::memory_order_relaxed);
  std::atomic_thread_fence(std::memory_order_release);
  row.kept = {};
  row.kept.at_ns =
      std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch()).count();
  row.kept.topic = static_cast<std::uint8_t>(topic);
  row.kept.sent = sent;
  row.kept.bytes = static_cast<std::uint32_t>(bytes);
  kFills[topic](row.kept, sample);
  row.number.store(before + 1, std::memory_order_release);
}

void write_last_messages(const std::string& path) noexcept {
  const Ring* const ring = own.load();
  if (ring == nullptr || launcher_writes) return;
  try {
    if (const std::string fault = write_ring(*ring, path); !fault.empty()) fmt::print(stderr, "warning: {}\n", fault);
  } catch (const std::exception& wrong) {
    fmt::print(stderr, "warning: {}: {}\n", path, wrong.what());
  }
}

}  // namespace subworld
