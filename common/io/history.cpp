#include "io/history.hpp"

#include "model/error.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <iterator>
#include <utility>

namespace subworld {

namespace {

History::Format csv(const std::vector<std::string>& columns) {
  return {.width = columns.size(),
          .head = fmt::format("{}\n", fmt::join(columns, ",")),
          .row = [](std::string& text, std::span<const double> row) {
            fmt::format_to(std::back_inserter(text), "{:.9g}\n", fmt::join(row, ","));
          }};
}

}  // namespace

History::History(const std::string& path, const std::vector<std::string>& columns, Flush flush)
    : History(path, csv(columns), flush) {}

History::History(const std::string& path, Format format, Flush flush) : format_(std::move(format)), flush_(flush) {
  if (path.empty()) return;
  file_ = std::fopen(path.c_str(), "w");
  if (file_ == nullptr) {
    throw Error(ExitCode::failed, fmt::format("{}: {}; choose another folder with --out", path, std::strerror(errno)));
  }
  std::fputs(format_.head.c_str(), file_);
  ring_.resize(kRows * format_.width);
  thread_ = std::thread([this] {
    while (!stop_.load(std::memory_order_acquire)) {
      const std::size_t waiting = head_.load(std::memory_order_acquire) - tail_.load(std::memory_order_relaxed);
      if (flush_ == Flush::often || waiting >= kRows / 2) write_out();
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    write_out();
  });
}

History::~History() {
  if (file_ == nullptr) return;
  stop_.store(true, std::memory_order_release);
  thread_.join();
  std::fputs(format_.tail.c_str(), file_);
  std::fclose(file_);
}

void History::row(std::initializer_list<double> values) noexcept {
  if (file_ == nullptr) return;
  const std::size_t head = head_.load(std::memory_order_relaxed);
  if (values.size() != format_.width || head - tail_.load(std::memory_order_acquire) >= kRows) {
    ++dropped_;
    return;
  }
  std::copy(values.begin(), values.end(), ring_.begin() + static_cast<std::ptrdiff_t>((head % kRows) * format_.width));
  head_.store(head + 1, std::memory_order_release);
}

void History::write_out() {
  std::string text;
  std::size_t tail = tail_.load(std::memory_order_relaxed);
  const std::size_t head = head_.load(std::memory_order_acquire);
  for (; tail != head; ++tail) {
    format_.row(text, std::span(ring_).subspan((tail % kRows) * format_.width, format_.width));
    tail_.store(tail + 1, std::memory_order_release);
  }
  std::fwrite(text.data(), 1, text.size(), file_);
  std::fflush(file_);
}

}  // namespace subworld
