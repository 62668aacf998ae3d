#pragma once

#include <array>
#include <atomic>
#include <cstddef>

namespace subworld {

/// A value that one thread renews and others read whole at any time. Nobody waits: the writer fills a slot that nobody
/// looks at and then points to it, readers hold the slot that they look at.
template <class T, std::size_t kReadersAtOnce = 2>
class Newest {
 public:
  Newest() = default;
  explicit Newest(const T& initial) {
    for (Slot& slot : slots_) slot.value = initial;
  }

  /// Calls `fill(T&)` on a slot that holds an old value, then shows it. Of one thread at a time. False, and nothing is
  /// shown, where more readers than kReadersAtOnce hold all the others.
  template <class Fill>
  bool renew(Fill&& fill) {
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      if (static_cast<int>(i) == newest_.load() || slots_[i].readers.load() != 0) continue;
      // A reader that comes now finds that this slot is not the newest and lets go without looking.
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
