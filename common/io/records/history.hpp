#pragma once

#include "model/types.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <type_traits>
#include <vector>

namespace subworld {

/// A file of numbers (CSV or other text) that a loop writes without blocking. Rows go through a ring to a thread of
/// their own. The thread writes them ten times a second in small pieces, so that a killed program loses few rows and no
/// write takes long. A full ring drops the row and counts it.
class History {
 public:
  using Say = std::function<void(std::string)>;

  static constexpr std::size_t kRows = 1 << 16;

  /// Conversion of rows of `width` numbers to text, with the head and the tail of the file.
  struct Format {
    std::size_t width = 0;
    std::string head;
    std::function<void(std::string& text, std::span<const double> row)> row;
    std::string tail = {};
    std::size_t rows = kRows;  ///< capacity of the ring
  };

  /// Throws `Error`: failed if the file cannot be opened, usage for a table that no run has made. The first row
  /// replaces what the file held: a program that is refused leaves the history of the one before. An empty path: rows
  /// are discarded. The writing thread calls `say` when rows cannot be written; they wait in the ring until writing
  /// succeeds.
  History(const std::string& path, Format format, Say say);
  /// As CSV; `columns` are the names, separated by commas.
  History(const std::string& path, const std::string& columns, Say say);
  ~History();
  History(const History&) = delete;
  History& operator=(const History&) = delete;

  /// Adds one row; as many numbers as there are columns. Always the same thread. Allocates nothing.
  void row(std::initializer_list<double> values) noexcept { row(std::span(values.begin(), values.size())); }
  void row(std::span<const double> values) noexcept;
  /// Adds one row of numbers, vectors (x, y, z) and quaternions (w, x, y, z).
  template <class... Parts>
  void row_of(const Parts&... parts) noexcept {
    std::array<double, (kNumbers<Parts> + ...)> values;
    double* next = values.data();
    const auto put = [&](const auto& part) {
      using Part = std::decay_t<decltype(part)>;
      if constexpr (std::is_same_v<Part, Quat>) {
        for (const double value : {part.w(), part.x(), part.y(), part.z()}) *next++ = value;
      } else if constexpr (std::is_same_v<Part, Vec3>) {
        next = std::copy_n(part.data(), 3, next);
      } else {
        *next++ = static_cast<double>(part);
      }
    };
    (put(parts), ...);
    row(std::span<const double>(values));
  }
  /// Whether this many rows fit now, for rows that are only useful together. `may_wait`: blocks until they fit, unless
  /// the file cannot be written. Same thread as `row`.
  [[nodiscard]] bool make_room(std::size_t rows, bool may_wait) noexcept;
  /// Rows wait in memory until release(), and are discarded without it: their program may be refused.
  void hold() noexcept { held_.store(true); }
  void release() noexcept { held_.store(false); }
  /// Before the first row: it follows those of a program that was killed, if the file has such rows. Its first number
  /// may be less than theirs: a run may have gone back to a checkpoint. A last row that is not whole is dropped.
  void append() noexcept { appends_.store(true); }
  /// Writes all remaining rows. No row may follow.
  void finish();

  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }
  /// Why rows could not be written; empty if there was no error.
  [[nodiscard]] std::string fault() const;

 private:
  template <class Part>
  static constexpr std::size_t kNumbers = std::is_same_v<Part, Quat>   ? 4
                                          : std::is_same_v<Part, Vec3> ? 3
                                                                       : 1;

  void write_out();
  /// Keeps the whole rows of the file; false: there are none.
  bool keep_rows();
  bool write_text();
  void pause();
  void hurry() noexcept;
  [[nodiscard]] std::size_t waiting() const noexcept { return head_.load() - tail_.load(); }

  std::string path_;
  Format format_;
  Say say_;
  std::vector<double> ring_;
  std::atomic<std::size_t> head_{0};  ///< rows written by the loop
  std::atomic<std::size_t> tail_{0};  ///< rows taken by the thread
  std::atomic<bool> stop_{false};
  std::atomic<bool> held_{false}, appends_{false};
  std::atomic<int> error_{0};  ///< the last errno of a write
  std::mutex mutex_;           ///< of hurried_
  std::condition_variable wake_;
  bool hurried_ = false;  ///< a caller waits for the thread
  std::uint64_t dropped_ = 0;
  bool begun_ = false;    ///< the head is in text_ or written; of the thread
  bool removed_ = false;  ///< the file, by somebody; set before the thread ends
  int file_ = -1;
  std::string text_;           ///< text of rows taken from the ring
  std::size_t text_done_ = 0;  ///< bytes of text_ that are written
  std::thread thread_;
};

}  // namespace subworld
