#pragma once

#include <array>
#include <cstddef>
#include <string>

namespace subworld::test {

/// Number of this program's allocations: `malloc` and its relatives, so `operator new` and Eigen's dynamic matrices
/// too. Linking the source file replaces these functions. (With the address sanitizer: `operator new`.)
[[nodiscard]] long allocations() noexcept;

/// Counts allocations of the calling thread during its lifetime, by origin.
class AllocationWatch {
 public:
  AllocationWatch() noexcept;
  ~AllocationWatch();
  AllocationWatch(const AllocationWatch&) = delete;
  AllocationWatch& operator=(const AllocationWatch&) = delete;

  /// So far, without those of engines.
  [[nodiscard]] long ours() const noexcept { return ours_; }
  /// Those with a function of an engine's library on the stack.
  [[nodiscard]] long of_engines() const noexcept { return of_engines_; }
  /// Origins of the first few different allocations outside engines: the functions on the stack, innermost first, if
  /// the program exports them (ENABLE_EXPORTS).
  [[nodiscard]] std::string places() const;

  void note() noexcept;

 private:
  struct Stack {
    std::array<void*, 48> functions{};
    int depth = 0;
    bool operator==(const Stack&) const = default;
  };
  std::array<Stack, 8> places_;
  std::size_t place_count_ = 0;
  long ours_ = 0;
  long of_engines_ = 0;
};

}  // namespace subworld::test
