#pragma once

#include "model/messages/exchange.hpp"
#include "model/scene/scene.hpp"
#include "model/settings/journey.hpp"
#include "wire/topics.hpp"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <limits>
#include <mutex>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace subworld::wire {

inline constexpr std::size_t kHeaderBytes = 4;  ///< of the encoded bytes, before the key

/// Artificial delay, jitter and loss of the samples of a reader, in real time.
struct Transit {
  Journey journey;
  Direction direction;
  bool repeats;  ///< lost samples are sent again, and none overtakes another
};

/// Received samples that a loop has not taken yet, oldest first. The vendor's thread puts them here as they arrive. The
/// vendors' own histories share their room among all writers of a key, so that a foreign writer would evict the samples
/// of the right one. Here each writer has its own room: the newest `depth` samples of each key.
///
/// A trusted writer is the only one whose samples are held. Trust ends where the writer is dead, or silent for two
/// seconds while another one writes: a program that is started again is received at once.
class HeldSamples {
 public:
  using Clock = std::chrono::steady_clock;

  HeldSamples(const TopicSpec& topic, const Qos& qos, const std::optional<Transit>& transit)
      : key_bytes_(4 * topic.key_words),
        depth_(qos.keep_all ? std::numeric_limits<std::ptrdiff_t>::max() : qos.depth),
        transit_(transit) {
    spare_.reserve(kSpareBuffers);
    foreign_.reserve(kMostForeign);
  }

  /// Takes the bytes over and leaves a buffer in their place. False if they are of a foreign writer, and dropped.
  bool put(std::uint64_t writer, std::vector<std::uint8_t>& bytes, Clock::time_point now) {
    const std::lock_guard lock(mutex_);
    if (writer == trusted_) last_of_trusted_ = now, dead_ = false;
    if (!accepts(writer, now)) {
      refuse(writer);
      return false;
    }
    const std::uint64_t number = arrived_++;
    const Clock::time_point due = transit_ ? arrival(number, now) : now;
    if (due == kNever) return true;
    const auto same = [&](const Held& one) {
      return one.writer == writer && one.due <= now && has_same_key(one.bytes, bytes);
    };
    give_up(now);
    const std::ptrdiff_t itself = due <= now ? 1 : 0;
    while (std::ranges::count_if(held_, same) > depth_ - itself) remove(std::ranges::find_if(held_, same));
    const auto place = repeats() ? held_.end() : std::ranges::upper_bound(held_, due, {}, &Held::due);
    held_.insert(place, {writer, number, due, std::exchange(bytes, spare())});
    return true;
  }

  /// Swaps the oldest sample into `bytes`.
  bool take(std::vector<std::uint8_t>& bytes, std::uint64_t& writer) noexcept {
    const std::lock_guard lock(mutex_);
    // Those that arrived before their writer became a foreign one.
    while (!held_.empty() && trusted_ && !dead_ && held_.front().writer != trusted_) {
      refuse(held_.front().writer);
      remove(held_.begin());
    }
    if (transit_) {
      const Clock::time_point now = Clock::now();
      give_up(now);
      while (!held_.empty() && held_.front().number < next_) remove(held_.begin());  // overtaken
      if (held_.empty() || held_.front().due > now) return false;
    }
    if (held_.empty()) return false;
    std::swap(bytes, held_.front().bytes);
    writer = held_.front().writer;
    next_ = held_.front().number + 1;
    remove(held_.begin());
    return true;
  }

  /// From now on accepts this writer alone, unless one is trusted that lives.
  void trust(std::uint64_t writer) noexcept {
    const std::lock_guard lock(mutex_);
    if (trusted_ && !dead_) return;
    trusted_ = writer;
    dead_ = false;
    last_of_trusted_ = Clock::now();
  }

  /// From now on accepts every writer.
  void distrust() noexcept {
    const std::lock_guard lock(mutex_);
    trusted_.reset();
    dead_ = false;
  }

  /// The middleware has noticed that the writer is dead.
  void bury(std::uint64_t writer) noexcept {
    const std::lock_guard lock(mutex_);
    dead_ |= writer == trusted_;
  }

  /// Number of samples of foreign writers.
  [[nodiscard]] std::uint64_t refused() const noexcept {
    const std::lock_guard lock(mutex_);
    return refused_;
  }
  /// The first of them.
  [[nodiscard]] std::vector<std::uint64_t> foreign_writers() const {
    const std::lock_guard lock(mutex_);
    return foreign_;
  }

 private:
  static constexpr std::size_t kMostForeign = 4;
  static constexpr std::size_t kSpareBuffers = 64;
  static constexpr std::chrono::seconds kAbsence{2};
  static constexpr Clock::time_point kNever = Clock::time_point::max();

  struct Held {
    std::uint64_t writer = 0;
    std::uint64_t number = 0;  ///< in the order in which they came
    Clock::time_point due;     ///< may be taken from then on
    std::vector<std::uint8_t> bytes;
  };

  /// When the sample of this number, which has come without delay, arrives; kNever: it is lost.
  Clock::time_point arrival(std::uint64_t number, Clock::time_point now) noexcept {
    const auto& [journey, direction, repeats] = *transit_;
    if (!repeats && journey.is_lost(direction, number)) return kNever;
    double delay_s = journey.delay_s(direction, number);
    if (repeats) delay_s += static_cast<double>(journey.losses(direction, number)) * journey.repeat_s();
    return now + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(delay_s));
  }
  [[nodiscard]] bool repeats() const noexcept { return transit_ && transit_->repeats; }
  /// The writer repeats a lost sample as long as it is in its history: until `depth` others have come after it.
  void give_up(Clock::time_point now) noexcept {
    const auto arrived = [&](const Held& one) { return one.due <= now; };
    while (repeats() && !held_.empty() && !arrived(held_.front()) && std::ranges::count_if(held_, arrived) >= depth_)
      remove(held_.begin());
  }

  bool accepts(std::uint64_t writer, Clock::time_point now) noexcept {
    if (!trusted_ || writer == trusted_) return true;
    dead_ |= now - last_of_trusted_ > kAbsence;
    return dead_;
  }

  void refuse(std::uint64_t writer) noexcept {
    ++refused_;
    if (foreign_.size() < kMostForeign && std::ranges::find(foreign_, writer) == foreign_.end())
      foreign_.push_back(writer);
  }

  [[nodiscard]] bool has_same_key(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b) const noexcept {
    const std::size_t end = kHeaderBytes + key_bytes_;
    if (a.size() < end || b.size() < end) return a.size() < end && b.size() < end;
    return std::ranges::equal(a.subspan(kHeaderBytes, key_bytes_), b.subspan(kHeaderBytes, key_bytes_));
  }

  void remove(std::vector<Held>::iterator at) noexcept {
    if (spare_.size() < spare_.capacity()) spare_.push_back(std::move(at->bytes));
    held_.erase(at);
  }

  std::vector<std::uint8_t> spare() noexcept {
    std::vector<std::uint8_t> buffer;
    if (spare_.empty()) return buffer;
    buffer = std::move(spare_.back());
    spare_.pop_back();
    return buffer;
  }

  const std::size_t key_bytes_;
  const std::ptrdiff_t depth_;
  const std::optional<Transit> transit_;
  mutable std::mutex mutex_;
  std::uint64_t arrived_ = 0, next_ = 0;  ///< numbers of samples
  std::vector<Held> held_;
  std::vector<std::vector<std::uint8_t>> spare_;
  std::optional<std::uint64_t> trusted_;
  bool dead_ = false;  ///< the trusted one
  Clock::time_point last_of_trusted_;
  std::uint64_t refused_ = 0;
  std::vector<std::uint64_t> foreign_;
};

/// Whether a program may have this key: its words are below their limits. Readers refuse other keys, because a vendor
/// reserves room for each one. Bytes that are too short have no key.
inline bool is_known_key(const TopicSpec& topic, std::span<const std::uint8_t> bytes) noexcept {
  constexpr std::uint32_t kPrograms = static_cast<std::uint32_t>(ProgramKind::gui_headless) + 1;
  if (bytes.size() < kHeaderBytes + 4 * topic.key_words) return true;
  const bool little = (bytes[1] & 1) != 0;
  for (std::uint32_t word = 0; word < topic.key_words; ++word) {
    std::uint32_t value = 0;
    for (std::uint32_t i = 0; i < 4; ++i) value = (value << 8U) | bytes[kHeaderBytes + 4 * word + (little ? 3 - i : i)];
    if (value >= (topic.key_words == 2 && word == 0 ? kPrograms : kMostUsers)) return false;
  }
  return true;
}

}  // namespace subworld::wire
