#pragma once

#include <sys/types.h>

#include <chrono>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

namespace subworld::test {

using Words = std::vector<std::string>;
using Environment = std::map<std::string, std::string>;

/// Polls until `condition` holds; false after a time that is exceeded only by a fault.
template <class Condition>
bool eventually(Condition condition, double limit_s = 150.0) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(limit_s);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return true;
}

std::string read_text(const std::string& file);

/// A program that a test has started. The destructor ends the program.
class Process {
 public:
  enum class Output {
    files,     ///< `stdout.txt` and `stderr.txt` in the folder
    terminal,  ///< a terminal of its own, which is the session's controlling terminal
  };

  Process(const Words& words, const std::string& folder, const Environment& environment = {},
          Output output = Output::files);
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  [[nodiscard]] pid_t pid() const { return pid_; }
  void signal(int number) const;
  /// Output of the program on its terminal so far. A program blocks if its terminal is not read.
  const std::string& read_terminal();
  /// Keys for a program on its terminal.
  void type(const std::string& keys) const;
  void close_terminal();
  /// Exit code, or 128 + signal if a signal ended it; empty if it still runs after `limit_s`.
  std::optional<int> wait(double limit_s = 300.0);
  [[nodiscard]] std::string out() const { return read_text(folder_ + "/stdout.txt"); }
  [[nodiscard]] std::string err() const { return read_text(folder_ + "/stderr.txt"); }

 private:
  std::string folder_;
  pid_t pid_ = -1;
  int terminal_ = -1;
  std::string shown_;
};

/// A running program with `mark` in a word of its command line.
struct Running {
  pid_t pid = -1;
  Words words;
};
[[nodiscard]] std::vector<Running> running(const std::string& mark);

/// The DDS vendors' files in /dev/shm.
[[nodiscard]] std::set<std::string> shared_memory_files();

/// A DDS domain of 1 .. 59 that no other test on this machine uses; locked until this object is destroyed.
class TestDomain {
 public:
  TestDomain();
  ~TestDomain();
  TestDomain(const TestDomain&) = delete;
  TestDomain& operator=(const TestDomain&) = delete;
  [[nodiscard]] int number() const { return domain_; }
  [[nodiscard]] std::string text() const { return std::to_string(domain_); }

 private:
  int file_ = -1;
  int domain_ = -1;
};

}  // namespace subworld::test
