#include "io/results/output.hpp"

#include "model/error.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>

namespace subworld {

namespace {

std::atomic<int> first_error{0};  ///< errno of the first write to stdout that failed

bool on_terminal = false;  ///< stdout

/// Whether the reader of the output has closed its pipe or terminal: it wants no more.
bool has_left(int error) { return error == EPIPE || (error == EIO && on_terminal); }

ssize_t write_or_lose(void* cookie, const char* text, std::size_t size) {
  const int file = static_cast<int>(reinterpret_cast<std::intptr_t>(cookie));
  for (std::size_t done = 0; done < size;) {
    const ssize_t written = write(file, text + done, size - done);
    if (written > 0) done += static_cast<std::size_t>(written);
    if (written > 0 || errno == EINTR) continue;
    int none = 0;
    if (file == STDOUT_FILENO && !has_left(errno)) first_error.compare_exchange_strong(none, errno);
    break;
  }
  return static_cast<ssize_t>(size);
}

std::FILE* lossy(int file, int buffering) {
  void* const cookie = reinterpret_cast<void*>(static_cast<std::intptr_t>(file));
  std::FILE* const stream =
      fopencookie(cookie, "w", {.read = nullptr, .write = write_or_lose, .seek = nullptr, .close = nullptr});
  if (stream != nullptr) std::setvbuf(stream, nullptr, buffering, 0);
  return stream;
}

}  // namespace

void outlive_full_output() {
  static bool done = false;
  if (done) return;
  done = true;
  on_terminal = isatty(STDOUT_FILENO) != 0;
  if (std::FILE* const out = lossy(STDOUT_FILENO, on_terminal ? _IOLBF : _IOFBF)) stdout = out;
  if (std::FILE* const err = lossy(STDERR_FILENO, _IONBF)) stderr = err;
}

std::string lost_output() {
  std::fflush(stdout);
  const int error = first_error.load();
  if (error == 0) return {};
  return fmt::format("stdout: {}; what was printed is lost, the results are not", std::strerror(error));
}

int finished(const char* program, int code) {
  const std::string lost = lost_output();
  if (lost.empty()) return code;
  fmt::print(stderr, "{}: error: {}\n", program, lost);
  return code == static_cast<int>(ExitCode::done) ? static_cast<int>(ExitCode::failed) : code;
}

std::string temporary_folder() {
  const char* given = std::getenv("TMPDIR");
  return given != nullptr && access(given, W_OK | X_OK) == 0 ? given : "/tmp";
}

std::string shell_word(const std::string& word) {
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

std::string local_time(const char* form) {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  std::array<char, 80> text{};
  return {text.data(), std::strftime(text.data(), text.size(), form, localtime_r(&now, &parts))};
}

}  // namespace subworld
