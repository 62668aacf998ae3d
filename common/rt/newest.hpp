#pragma once

#include <array>
#include <atomic>
#include <cstddef>

namespace subworld {

/// A value that one thread writes and others read as a whole at any time, without blocking. The writer fills a slot
/// that has no reader and then publishes its index. Readers mark the slot that they read.
template <class T, std::size_t kReadersAtOnce = 2>
class Newest {
 public:
  Newest() = default;
  explicit Newest(const T& initial) {
    for (Slot& slot : slots_) slot.value = initial;
  }

  /// Calls `fill(T&)` on a slot that holds an old value, then publishes it. One thread at a time. Returns false,
  /// without publishing, if more than kReadersAtOnce readers occupy all other slots.
  template <class Fill>
  bool renew(Fill&& fill) {
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      if (static_cast<int>(i) == newest_.load() || slots_[i].readers.load() != 0) continue;
      // A reader that marks this slot now sees that it is not the newest, and leaves it unread.
      fill(slots_[i].value);
      newest_.store(static_cast<int>(i));
      return true;
    }
    return false;
  }

  /// Calls `use(const T&)` on the newest value. False while there is none.
  template <class Use>
  bool read(Use&& use) const {
    while (true) {
      const int newest = newest_.load();
      if (newest < 0) return false;
      const Slot& slot = slots_[static_cast<std::size_t>(newest)];
      slot.readers.fetch_add(1);
      if (newest_.load() == newest) {
        use(slot.value);
        slot.readers.fetch_sub(1);
        return true;
      }
      slot.readers.fetch_sub(1);
    }
  }

 private:
  struct Slot {
    T value{};
    mutable std::atomic<int> readers = 0;
  };
  std::array<Slot, kReadersAtOnce + 2> slots_;
  std::atomic<int> newest_ = -1;
};

}  // namespace subworld
