#include "support/allocations.hpp"

#include <cxxabi.h>
#include <dlfcn.h>
#include <execinfo.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <new>

namespace {

std::atomic<long> count = 0;
thread_local subworld::test::AllocationWatch* watch = nullptr;

void note() noexcept {
  count.fetch_add(1, std::memory_order_relaxed);
  if (watch != nullptr) watch->note();
}

}  // namespace

#ifdef __SANITIZE_ADDRESS__

void* operator new(std::size_t size) {
  note();
  if (void* memory = std::malloc(size == 0 ? 1 : size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

#else

extern "C" {

void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* memory, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) noexcept {
  note();
  return __libc_malloc(size);
}
void* calloc(std::size_t number, std::size_t size) noexcept {
  note();
  return __libc_calloc(number, size);
}
void* realloc(void* memory, std::size_t size) noexcept {
  note();
  return __libc_realloc(memory, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  note();
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** memory, std::size_t alignment, std::size_t size) noexcept {
  note();
  *memory = __libc_memalign(alignment, size);
  return *memory == nullptr ? ENOMEM : 0;
}

}  // extern "C"

#endif

namespace subworld::test {

namespace {

bool of_an_engine(void* address) noexcept {
  Dl_info where{};
  return dladdr(address, &where) != 0 && where.dli_fname != nullptr &&
         std::strstr(where.dli_fname, "libsubworld_engine_") != nullptr;
}

}  // namespace

long allocations() noexcept { return count; }

AllocationWatch::AllocationWatch() noexcept {
  void* here = nullptr;
  backtrace(&here, 1);  // allocates the first time
  watch = this;
}

AllocationWatch::~AllocationWatch() { watch = nullptr; }

void AllocationWatch::note() noexcept {
  watch = nullptr;  // the following may allocate
  Stack stack;
  stack.depth = backtrace(stack.functions.data(), static_cast<int>(stack.functions.size()));
  if (std::ranges::any_of(stack.functions, of_an_engine)) {
    ++of_engines_;
  } else {
    ++ours_;
    const auto end = places_.begin() + static_cast<std::ptrdiff_t>(place_count_);
    if (place_count_ < places_.size() && std::find(places_.begin(), end, stack) == end) places_[place_count_++] = stack;
  }
  watch = this;
}

std::string AllocationWatch::places() const {
  std::string text;
  for (std::size_t i = 0; i < place_count_; ++i) {
    text += "allocated in\n";
    for (int j = 0; j < places_[i].depth; ++j) {
      Dl_info where{};
      dladdr(places_[i].functions[static_cast<std::size_t>(j)], &where);
      if (where.dli_sname == nullptr) continue;
      int failed = 0;
      char* const name = abi::__cxa_demangle(where.dli_sname, nullptr, nullptr, &failed);
      text += std::string("  ") + (failed == 0 ? name : where.dli_sname) + "\n";
      std::free(name);
    }
  }
  return text;
}

}  // namespace subworld::test
