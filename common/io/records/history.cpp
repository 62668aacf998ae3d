#include "io/records/history.hpp"

#include "model/error.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <utility>

namespace subworld {

namespace {

constexpr std::chrono::milliseconds kWriteEvery{100};
constexpr std::chrono::milliseconds kLookForRoom{1};
constexpr std::size_t kPiece = 8192;  // bytes written at once
constexpr double kFar = 1000.0;       // of this size, 9 digits no longer hold a micrometre

void add_row(std::string& text, std::span<const double> row) {
  const auto digits = [](double value) { return std::abs(value) < kFar ? 9 : 15; };
  for (const double value : row) fmt::format_to(std::back_inserter(text), "{:.{}g},", value, digits(value));
  text.back() = '\n';
}

History::Format csv(const std::string& columns) {
  return {
      .width = 1 + static_cast<std::size_t>(std::ranges::count(columns, ',')), .head = columns + "\n", .row = add_row};
}

/// A table that does not begin with the first column of ours is somebody else's.
void refuse_foreign(const std::string& path, const std::string& head) {
  const std::string first = head.substr(0, head.find(',') + 1);
  if (first.empty() || first.find('\n') != std::string::npos || !std::filesystem::is_regular_file(path)) return;
  std::ifstream file(path);
  std::string found(first.size(), '\0');
  file.read(found.data(), static_cast<std::streamsize>(found.size()));
  if (file.gcount() == 0 || found == first) return;
  throw Error(ExitCode::usage,
              fmt::format("{}: exists, and no run has made it; move it, or choose another folder with --out", path));
}

}  // namespace

History::History(const std::string& path, const std::string& columns, Say say)
    : History(path, csv(columns), std::move(say)) {}

History::History(const std::string& path, Format format, Say say)
    : path_(path), format_(std::move(format)), say_(std::move(say)) {
  if (path.empty()) return;
  refuse_foreign(path, format_.head);
  file_ = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (file_ < 0) {
    throw Error(ExitCode::failed, fmt::format("{}: {}; choose another folder with --out", path, std::strerror(errno)));
  }
  ring_.resize(format_.rows * format_.width);
  thread_ = std::thread([this] {
    while (!stop_.load(std::memory_order_acquire)) {
      write_out();
      pause();
    }
    write_out();
    if (!begun_) return;
    text_ += format_.tail;
    write_text();
    struct stat now {};
    removed_ = fstat(file_, &now) == 0 && now.st_nlink == 0;
  });
}

History::~History() {
  finish();
  if (file_ >= 0) close(file_);
}

void History::finish() {
  if (!thread_.joinable()) return;
  stop_.store(true, std::memory_order_release);
  hurry();
  thread_.join();
}

void History::row(std::span<const double> values) noexcept {
  if (file_ < 0) return;
  const std::size_t head = head_.load(std::memory_order_relaxed);
  if (values.size() != format_.width || head - tail_.load(std::memory_order_acquire) >= format_.rows) {
    ++dropped_;
    return;
  }
  std::copy(values.begin(), values.end(),
            ring_.begin() + static_cast<std::ptrdiff_t>((head % format_.rows) * format_.width));
  head_.store(head + 1, std::memory_order_release);
}

bool History::make_room(std::size_t rows, bool may_wait) noexcept {
  if (file_ < 0) return true;
  while (format_.rows - waiting() < rows) {
    if (!may_wait || rows > format_.rows || error_.load() != 0) return false;
    hurry();
    std::this_thread::sleep_for(kLookForRoom);
  }
  return true;
}

std::string History::fault() const {
  const int error = error_.load();
  if (error == 0 && removed_) return path_ + ": was removed during the run";
  return error == 0 ? "" : fmt::format("{}: {}", path_, std::strerror(error));
}

void History::write_out() {
  std::size_t tail = tail_.load(std::memory_order_relaxed);
  const std::size_t head = head_.load(std::memory_order_acquire);
  if (!begun_ && (tail == head || held_.load())) return;
  if (!std::exchange(begun_, true) && !(appends_.load() && tail != head && keep_rows())) {
    [[maybe_unused]] const int pipes_cannot = ftruncate(file_, 0);
    text_ = format_.head;
  }
  while (write_text() && tail != head) {
    for (; tail != head && text_.size() < kPiece; ++tail) {
      format_.row(text_, std::span(ring_).subspan((tail % format_.rows) * format_.width, format_.width));
    }
    tail_.store(tail, std::memory_order_release);
  }
}

bool History::keep_rows() {
  constexpr off_t kLongestRow = 4096;
  const off_t size = lseek(file_, 0, SEEK_END);
  std::string head(format_.head.size(), '\0'),
      tail(static_cast<std::size_t>(std::clamp<off_t>(size, 0, kLongestRow)), '\0');
  const off_t tail_at = size - static_cast<off_t>(tail.size());
  const bool read = pread(file_, head.data(), head.size(), 0) == static_cast<ssize_t>(head.size()) &&
                    pread(file_, tail.data(), tail.size(), tail_at) == static_cast<ssize_t>(tail.size());
  const std::size_t end = tail.rfind('\n');
  const std::size_t row = end == std::string::npos || end == 0 ? std::string::npos : tail.rfind('\n', end - 1);
  const bool follows = read && head == format_.head && row != std::string::npos;
  const bool keeps = follows && ftruncate(file_, tail_at + static_cast<off_t>(end) + 1) == 0;
  lseek(file_, 0, keeps ? SEEK_END : SEEK_SET);
  return keeps;
}

/// Sleeps until the next rows are due, or until a caller waits for room. Returns at once if many rows have arrived
/// meanwhile.
void History::pause() {
  std::unique_lock lock(mutex_);
  if (waiting() > format_.rows / 2 && error_.load() == 0) return;
  wake_.wait_for(lock, kWriteEvery, [this] { return hurried_; });
  hurried_ = false;
}

void History::hurry() noexcept {
  {
    const std::lock_guard lock(mutex_);
    hurried_ = true;
  }
  wake_.notify_one();
}

/// False if some text could not be written; it is tried again later.
bool History::write_text() {
  while (text_done_ < text_.size()) {
    const ssize_t written = write(file_, text_.data() + text_done_, text_.size() - text_done_);
    if (written > 0) {
      text_done_ += static_cast<std::size_t>(written);
    } else if (errno != EINTR) {
      if (error_.exchange(errno) == 0 && say_)
        say_(fault() + "; rows wait in memory and are lost when the memory is full too: free some disk space");
      return false;
    }
  }
  text_.clear();
  text_done_ = 0;
  return true;
}

}  // namespace subworld
