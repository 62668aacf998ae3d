#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <thread>
#include <vector>

namespace subworld {

/// Threads that share the parts of a loop. The parts must not depend on each other; then the number of threads changes
/// no result. Without work they sleep. Calls allocate nothing.
class Workers {
 public:
  /// `threads`: with the caller's, at least 1.
  explicit Workers(int threads);
  ~Workers();
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  [[nodiscard]] int threads() const noexcept { return static_cast<int>(threads_.size()) + 1; }

  /// Calls `part(begin, end)` until it has been called for all of 0 .. count - 1, for at most `grain` of them at a
  /// time. Returns when all calls have returned. `part` must not throw, and must not call run().
  template <class Part>
  void run(std::size_t count, std::size_t grain, const Part& part) {
    if (threads_.empty() || count <= grain) {
      if (count > 0) part(std::size_t{0}, count);
      return;
    }
    const auto call = [](const void* of, std::size_t begin, std::size_t end) {
      (*static_cast<const Part*>(of))(begin, end);
    };
    run(Job{call, &part, count, grain});
  }

 private:
  struct Job {
    void (*call)(const void* part, std::size_t begin, std::size_t end) = nullptr;
    const void* part = nullptr;
    std::size_t count = 0, grain = 1;
  };
  void run(const Job& job);
  void work();
  /// Takes parts of the job that has begun, and does them, until there are none.
  void help();

  std::vector<std::thread> threads_;
  Job job_;
  /// Number of the job in the upper half, of its parts that nobody has taken in the lower: who takes one knows that the
  /// job has not ended.
  std::atomic<std::uint64_t> parts_{0};
  std::atomic<std::uint32_t> undone_{0};
  std::atomic<bool> stops_{false};
};

}  // namespace subworld
