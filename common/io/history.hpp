#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <thread>
#include <vector>

namespace subworld {

/// A file of numbers, CSV or other text, that a loop can write to without waiting: rows go through a ring to a thread
/// of their own. A full ring drops the row and counts it.
class History {
 public:
  enum class Flush : std::uint8_t {
    often,   ///< ten times a second
    rarely,  ///< when the ring is half full: a kernel that writes to a disk may not be preempted by a real-time loop
  };

  /// What rows of `width` numbers become, after the head of the file and before its tail.
  struct Format {
    std::size_t width = 0;
    std::string head;
    std::function<void(std::string& text, std::span<const double> row)> row;
    std::string tail = {};
  };

  /// Throws `Error` (failed) where the file cannot be written. An empty path: rows go nowhere.
  History(const std::string& path, Format format, Flush flush);
  /// As CSV.
  History(const std::string& path, const std::vector<std::string>& columns, Flush flush);
  ~History();
  History(const History&) = delete;
  History& operator=(const History&) = delete;

  /// One row; as many numbers as there are columns. One thread. Allocates nothing.
  void row(std::initializer_list<double> values) noexcept;
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }

 private:
  void write_out();

  static constexpr std::size_t kRows = 1 << 16;
  Format format_;
  Flush flush_;
  std::vector<double> ring_;
  std::atomic<std::size_t> head_{0};  ///< rows written by the loop
  std::atomic<std::size_t> tail_{0};  ///< rows taken by the thread
  std::atomic<bool> stop_{false};
  std::uint64_t dropped_ = 0;
  std::FILE* file_ = nullptr;
  std::thread thread_;
};

}  // namespace subworld
