#include "lab/session/apart.hpp"

#include "lab/session/setting.hpp"
#include "model/error.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>

#include <poll.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

namespace subworld {

namespace {

using Clock = std::chrono::steady_clock;

[[noreturn]] void answer(int pipe, const std::function<Json()>& work) {
  const rlimit none{0, 0};
  setrlimit(RLIMIT_CORE, &none);
  std::string text;
  try {
    text = work().dump();
  } catch (const std::exception& wrong) {
    fmt::print(stderr, "{}\n", wrong.what());
    _exit(1);
  }
  std::size_t written = 0;
  while (written < text.size()) {
    const ssize_t n = write(pipe, text.data() + written, text.size() - written);
    if (n < 0 && errno != EINTR) _exit(1);
    if (n > 0) written += static_cast<std::size_t>(n);
  }
  _exit(0);
}

enum class Read : std::uint8_t { all, late, stopped };

Read read_all(int pipe, double most_s, std::string& text) {
  const auto end = Clock::now() + std::chrono::duration<double>(most_s);
  for (;;) {
    if (stop_signal() != 0) return Read::stopped;
    if (Clock::now() > end) return Read::late;
    pollfd ready{.fd = pipe, .events = POLLIN, .revents = 0};
    constexpr int kPatience_ms = 200;
    if (poll(&ready, 1, kPatience_ms) <= 0) continue;
    char buffer[4096];
    const ssize_t n = read(pipe, buffer, sizeof buffer);
    if (n == 0) return Read::all;
    if (n > 0) text.append(buffer, static_cast<std::size_t>(n));
  }
}

std::string end_of(int status) {
  if (WIFSIGNALED(status)) return fmt::format("SIG{}", sigabbrev_np(WTERMSIG(status)));
  return fmt::format("exit code {}", WEXITSTATUS(status));
}

}  // namespace

Apart apart(double most_s, const std::function<Json()>& work) {
  int ends[2];
  if (pipe(ends) != 0) throw Error(ExitCode::failed, fmt::format("no pipe to a process: {}", std::strerror(errno)));
  std::fflush(nullptr);
  const pid_t child = fork();
  if (child < 0) throw Error(ExitCode::failed, fmt::format("no process: {}", std::strerror(errno)));
  if (child == 0) {
    close(ends[0]);
    answer(ends[1], work);
  }
  close(ends[1]);
  std::string text;
  const Read read = read_all(ends[0], most_s, text);
  close(ends[0]);
  if (read != Read::all) kill(child, SIGKILL);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (read == Read::stopped) throw Interrupted{};
  if (read == Read::late) return {std::nullopt, fmt::format("no end within {:g} s", most_s)};
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) return {std::nullopt, end_of(status)};
  return {Json::parse(text), ""};
}

}  // namespace subworld
