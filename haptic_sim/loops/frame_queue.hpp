#pragma once

#include "model/messages/exchange.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

namespace subworld {

/// The world's frames that a sub-world has received and may not use yet, oldest first. Allocates nothing.
class FrameQueue {
 public:
  /// `newest_stamp`: of the frame that was used last.
  explicit FrameQueue(std::uint64_t newest_stamp) : newest_stamp_(newest_stamp) {
    for (WorldFrame& frame : frames_) reserve(frame, kUsualMembers);
  }

  [[nodiscard]] bool full() const noexcept { return count_ == frames_.size(); }
  /// Where the next frame is received.
  [[nodiscard]] WorldFrame& slot() noexcept { return frames_[count_]; }
  /// Queues what the slot holds and returns it; null where its stamp cannot follow the newest one. A world that is
  /// paused sends the same stamp again: only the newest of equal stamps is kept.
  WorldFrame* push() noexcept {
    const std::uint64_t stamp = frames_[count_].stamp;
    if (newest_stamp_ != kAnyStamp && (stamp < newest_stamp_ || stamp > newest_stamp_ + kFarAhead)) return nullptr;
    newest_stamp_ = stamp;
    if (count_ > 0 && frames_[count_ - 1].stamp == stamp) {
      std::swap(frames_[count_], frames_[count_ - 1]);
    } else {
      ++count_;
    }
    return &frames_[count_ - 1];
  }

  /// Forgets all; the next frame may have any stamp.
  void restart() noexcept {
    count_ = 0;
    newest_stamp_ = kAnyStamp;
  }

  [[nodiscard]] std::span<const WorldFrame> waiting() const noexcept { return {frames_.data(), count_}; }
  /// Drops the oldest.
  void drop(std::size_t count) noexcept {
    std::rotate(frames_.begin(), frames_.begin() + static_cast<std::ptrdiff_t>(count),
                frames_.begin() + static_cast<std::ptrdiff_t>(count_));
    count_ -= count;
  }

 private:
  static constexpr std::uint64_t kFarAhead = 10'000;  ///< cycles; no world skips so many
  static constexpr std::uint64_t kAnyStamp = ~std::uint64_t{0};

  std::array<WorldFrame, 16> frames_;
  std::size_t count_ = 0;
  std::uint64_t newest_stamp_;
};

}  // namespace subworld
