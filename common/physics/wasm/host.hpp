#pragma once

#include "physics/wasm/wasm-rt.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>
#include <vector>

namespace subworld::wasm {

/// An address in a module's linear memory.
using Address = std::uint32_t;

/// Bytes [at, at + size) of the module's memory. Throws `Error` if they are not all inside.
[[nodiscard]] inline std::uint8_t* inside(const wasm_rt_memory_t& memory, Address at, std::uint64_t size) {
  if (at + size > memory.size) wasm_rt_trap(WASM_RT_TRAP_OOB);
  return memory.data + at;
}

template <class T>
[[nodiscard]] T load(const wasm_rt_memory_t& memory, Address at) {
  static_assert(std::is_trivially_copyable_v<T>);
  T value;
  std::memcpy(&value, inside(memory, at, sizeof value), sizeof value);
  return value;
}

template <class T>
void store(const wasm_rt_memory_t& memory, Address at, const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  std::memcpy(inside(memory, at, sizeof value), &value, sizeof value);
}

template <class T>
void store_all(const wasm_rt_memory_t& memory, Address at, std::span<const T> values) {
  static_assert(std::is_trivially_copyable_v<T>);
  std::memcpy(inside(memory, at, values.size_bytes()), values.data(), values.size_bytes());
}

/// A range of a module's memory for the arguments and results of calls: a struct argument is an address in wasm, and a
/// struct result is written to an address.
class Scratch {
 public:
  Scratch() = default;
  Scratch(const wasm_rt_memory_t& memory, Address begin, std::uint32_t size)
      : memory_(&memory), begin_(begin), end_(begin + size), next_(begin) {}

  /// Discards the contents; call before each group of arguments.
  Scratch& reset() noexcept {
    next_ = begin_;
    return *this;
  }
  template <class T>
  [[nodiscard]] Address put(const T& value) {
    const Address at = room<T>();
    store(*memory_, at, value);
    return at;
  }
  template <class T>
  [[nodiscard]] Address room() {
    const Address at = next_;
    next_ += (sizeof(T) + 15U) & ~15U;
    if (next_ > end_) wasm_rt_trap(WASM_RT_TRAP_OOB);
    return at;
  }
  template <class T>
  [[nodiscard]] T get(Address at) const {
    return load<T>(*memory_, at);
  }

 private:
  const wasm_rt_memory_t* memory_ = nullptr;
  Address begin_ = 0, end_ = 0, next_ = 0;
};

/// Appends the contents of the memory, without blocks of zeros. Exact: between two calls the whole state of a module is
/// in its memory.
void save(const wasm_rt_memory_t& memory, std::vector<std::byte>& out);
/// Restores what save() wrote, of this or another instance of the same module. Throws `Error` if `saved` is of another
/// format.
void restore(wasm_rt_memory_t& memory, std::span<const std::byte> saved);

}  // namespace subworld::wasm

/// Imports of a module made by Emscripten, for one instance. The clock is constant, because an engine must not depend
/// on it.
struct w2c_env {
  wasm_rt_memory_t* memory = nullptr;
  /// For a module that calls JavaScript: `code` identifies the piece; the arguments are in the module's memory.
  std::uint32_t (*call_out)(void* owner, std::uint32_t code, std::uint32_t signature,
                            std::uint32_t arguments) = nullptr;
  void* owner = nullptr;
};
struct w2c_wasi__snapshot__preview1 {};
