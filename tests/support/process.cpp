#include "support/process.hpp"

#include <fcntl.h>
#include <pty.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>

namespace subworld::test {

namespace {

constexpr int kFirstDomain = 1;  // ports of domains below 102 are not assigned to other sockets
constexpr int kLastDomain = 59;

[[noreturn]] void become(std::vector<char*>& argv, const Environment& environment) {
  for (const auto& [name, value] : environment) setenv(name.c_str(), value.c_str(), 1);
  execv(argv.front(), argv.data());
  _exit(126);
}

void redirect(const std::string& file, int to) {
  const int opened = open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  dup2(opened, to);
  close(opened);
}

/// The lock file, locked; -1 if another process has locked it.
int lock(const std::string& name) {
  const auto path = std::filesystem::temp_directory_path() / name;
  const int file = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (file >= 0 && flock(file, LOCK_EX | LOCK_NB) == 0) return file;
  if (file >= 0) close(file);
  return -1;
}

}  // namespace

std::string read_text(const std::string& file) {
  const std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();  // does not throw if a process ends while its file in /proc is read
  return text.str();
}

Process::Process(const Words& words, const std::string& folder, const Environment& environment, Output output)
    : folder_(folder) {
  std::vector<char*> argv;
  for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  // Before the process begins: nobody reads what an earlier one has written.
  if (output == Output::files)
    for (const char* file : {"/stdout.txt", "/stderr.txt"}) std::ofstream(folder + file);
  pid_ = output == Output::terminal ? forkpty(&terminal_, nullptr, nullptr, nullptr) : fork();
  if (pid_ < 0) throw std::runtime_error("cannot fork");
  if (pid_ > 0) {
    if (terminal_ >= 0) fcntl(terminal_, F_SETFL, O_NONBLOCK);
    return;
  }
  if (output == Output::files) {
    redirect(folder + "/stdout.txt", STDOUT_FILENO);
    redirect(folder + "/stderr.txt", STDERR_FILENO);
  }
  become(argv, environment);
}

Process::~Process() {
  if (pid_ > 0) {
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  close_terminal();
}

void Process::signal(int number) const {
  if (pid_ > 0) kill(pid_, number);
}

const std::string& Process::read_terminal() {
  char buffer[4096];
  for (ssize_t size = 0; (size = read(terminal_, buffer, sizeof buffer)) > 0;) {
    shown_.append(buffer, static_cast<std::size_t>(size));
  }
  return shown_;
}

void Process::type(const std::string& keys) const { (void)!write(terminal_, keys.data(), keys.size()); }

void Process::close_terminal() {
  if (terminal_ >= 0) close(terminal_);
  terminal_ = -1;
}

std::optional<int> Process::wait(double limit_s) {
  int status = 0;
  if (!eventually([&] { return waitpid(pid_, &status, WNOHANG) == pid_; }, limit_s)) return std::nullopt;
  pid_ = -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

std::vector<Running> running(const std::string& mark) {
  std::vector<Running> found;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator("/proc", ignored)) {
    const std::string name = entry.path().filename().string();
    if (!std::all_of(name.begin(), name.end(), [](char c) { return c >= '0' && c <= '9'; })) continue;
    const std::string line = read_text(entry.path().string() + "/cmdline");
    if (line.find(mark) == std::string::npos) continue;
    Running one{.pid = static_cast<pid_t>(std::stol(name)), .words = {}};
    for (std::size_t at = 0; at < line.size(); at = line.find('\0', at) + 1) one.words.emplace_back(line.c_str() + at);
    if (one.pid != getpid()) found.push_back(std::move(one));
  }
  return found;
}

std::set<std::string> shared_memory_files() {
  std::set<std::string> names;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator("/dev/shm", ignored)) {
    const std::string name = entry.path().filename().string();
    for (const char* start : {"fastrtps", "fast_datasharing", "sem.fastrtps", "iox"}) {
      if (name.starts_with(start)) names.insert(name);
    }
  }
  return names;
}

namespace {

bool in_use(const std::string& domain) {
  for (const Running& one : running("--domain")) {
    const auto flag = std::find(one.words.begin(), one.words.end(), "--domain");
    if (flag != one.words.end() && flag + 1 != one.words.end() && *(flag + 1) == domain) return true;
  }
  return false;
}

}  // namespace

TestDomain::TestDomain() {
  static int tests = 0;
  const int count = kLastDomain - kFirstDomain + 1;
  const int first = (getpid() + tests++) % count;
  for (int i = 0; i < count; ++i) {
    const int domain = kFirstDomain + (first + i) % count;
    file_ = lock("subworld-test-domain-" + std::to_string(domain) + ".lock");
    if (file_ < 0) continue;
    // A run by hand may use it, or a program that still runs from an earlier test.
    if (!in_use(std::to_string(domain))) {
      domain_ = domain;
      return;
    }
    close(file_);
  }
  throw std::runtime_error("every test domain is in use");
}

TestDomain::~TestDomain() { close(file_); }

}  // namespace subworld::test
