#include "model/error.hpp"
#include "physics/wasm/wasm-rt.h"

#include <fmt/core.h>

#include <sys/mman.h>
#include <ucontext.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <string_view>

namespace {

constexpr std::uint64_t kPage = 65536;

std::string_view reason(wasm_rt_trap_t trap) {
  switch (trap) {
    case WASM_RT_TRAP_OOB:
      return "access outside of its memory";
    case WASM_RT_TRAP_INT_OVERFLOW:
      return "integer overflow";
    case WASM_RT_TRAP_DIV_BY_ZERO:
      return "integer division by zero";
    case WASM_RT_TRAP_INVALID_CONVERSION:
      return "conversion of a value that is not a number";
    case WASM_RT_TRAP_UNREACHABLE:
      return "aborted (unreachable)";
    case WASM_RT_TRAP_CALL_INDIRECT:
      return "indirect call of a missing function or of another type";
    case WASM_RT_TRAP_EXHAUSTION:
      return "calls nested too deeply";
    case WASM_RT_TRAP_NONE:
      break;
  }
  return "unknown trap";
}

#if WASM_RT_MEMCHECK_GUARD_PAGES
/// Largest offset that an address and an offset of 32 bits each can reach, with the widest access.
constexpr std::uint64_t kReachable = (std::uint64_t{1} << 33) + kPage;
#else
constexpr std::uint64_t kReachable = 0;
#endif

std::uint64_t reserved_bytes(std::uint64_t max_pages) { return std::max(max_pages * kPage, kReachable); }

[[noreturn]] void no_memory(std::uint64_t bytes) {
  throw subworld::Error(subworld::ExitCode::failed,
                        fmt::format("no address space for an engine of {} MiB; end other programs or raise the limit "
                                    "(ulimit -v)",
                                    bytes >> 20));
}

#if WASM_RT_MEMCHECK_GUARD_PAGES

/// Address ranges of the instances, for the fault handler; 0: free.
constexpr std::size_t kMostInstances = 1024;
std::array<std::atomic<std::uintptr_t>, kMostInstances> reservations;
struct sigaction before_ours;

bool is_reserved(const void* address) {
  const auto at = reinterpret_cast<std::uintptr_t>(address);
  return std::ranges::any_of(reservations, [&](const auto& one) {
    const std::uintptr_t begin = one.load(std::memory_order_acquire);
    return begin != 0 && at >= begin && at - begin < kReachable;
  });
}

[[noreturn]] __attribute__((force_align_arg_pointer)) void go_outside() { wasm_rt_trap(WASM_RT_TRAP_OOB); }

/// Resumes the faulting code as if it had called go_outside() there, so that the exception unwinds through it.
void on_fault(int signal, siginfo_t* info, void* context) {
  if (is_reserved(info->si_addr)) {
    auto& registers = static_cast<ucontext_t*>(context)->uc_mcontext.gregs;
    // An unwinder searches for a call just before the return address.
    const greg_t back = registers[REG_RIP] + 1;
    registers[REG_RSP] -= static_cast<greg_t>(sizeof back);
    std::memcpy(reinterpret_cast<void*>(registers[REG_RSP]), &back, sizeof back);
    registers[REG_RIP] = reinterpret_cast<greg_t>(&go_outside);
  } else if ((before_ours.sa_flags & SA_SIGINFO) != 0) {
    before_ours.sa_sigaction(signal, info, context);
  } else {
    sigaction(signal, &before_ours, nullptr);  // the access faults again, with the previous handler
  }
}

void guard(std::uint8_t* begin) {
  static std::once_flag once;
  std::call_once(once, [] {
    struct sigaction ours {};
    ours.sa_sigaction = on_fault;
    ours.sa_flags = SA_SIGINFO | SA_ONSTACK;
    sigaction(SIGSEGV, &ours, &before_ours);
  });
  const auto address = reinterpret_cast<std::uintptr_t>(begin);
  for (auto& one : reservations) {
    std::uintptr_t none = 0;
    if (one.compare_exchange_strong(none, address, std::memory_order_acq_rel)) return;
  }
  throw subworld::Error(subworld::ExitCode::failed,
                        fmt::format("more than {} WebAssembly engines in one program", kMostInstances));
}

void unguard(std::uint8_t* begin) {
  for (auto& one : reservations) {
    auto address = reinterpret_cast<std::uintptr_t>(begin);
    if (one.compare_exchange_strong(address, 0, std::memory_order_acq_rel)) return;
  }
}

#else

void guard(std::uint8_t*) {}
void unguard(std::uint8_t*) {}

#endif

}  // namespace

extern "C" {

__thread std::uint32_t wasm_rt_call_stack_depth = 0;

void wasm_rt_trap(wasm_rt_trap_t trap) {
  wasm_rt_call_stack_depth = 0;  // unwinding skips the epilogues that decrement it
  throw subworld::Error(subworld::ExitCode::failed, fmt::format("the engine's wasm code stopped: {}", reason(trap)));
}

void wasm_rt_allocate_memory(wasm_rt_memory_t* memory, std::uint64_t pages, std::uint64_t max_pages, bool,
                             std::uint32_t) {
  *memory = {};
  const std::uint64_t reserved = reserved_bytes(max_pages);
  // Only memory in use may be touched: a process that locks its memory would fill and lock the whole reservation.
  void* base = mmap(nullptr, reserved, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (base == MAP_FAILED) no_memory(reserved);
  if (mprotect(base, pages * kPage, PROT_READ | PROT_WRITE) != 0) no_memory(pages * kPage);
  guard(static_cast<std::uint8_t*>(base));
  *memory = {static_cast<std::uint8_t*>(base), pages, max_pages, pages * kPage};
}

std::uint64_t wasm_rt_grow_memory(wasm_rt_memory_t* memory, std::uint64_t pages) {
  const std::uint64_t before = memory->pages;
  if (pages > memory->max_pages - before) return UINT32_MAX;
  if (mprotect(memory->data + before * kPage, pages * kPage, PROT_READ | PROT_WRITE) != 0) return UINT32_MAX;
  memory->pages = before + pages;
  memory->size = memory->pages * kPage;
  return before;
}

void wasm_rt_free_memory(wasm_rt_memory_t* memory) {
  if (memory->data) {
    unguard(memory->data);
    munmap(memory->data, reserved_bytes(memory->max_pages));
  }
  *memory = {};
}

void wasm_rt_allocate_funcref_table(wasm_rt_funcref_table_t* table, std::uint32_t size, std::uint32_t max_size) {
  *table = {static_cast<wasm_rt_funcref_t*>(std::calloc(size, sizeof(wasm_rt_funcref_t))), max_size, size};
  if (!table->data) no_memory(size * sizeof(wasm_rt_funcref_t));
}

void wasm_rt_free_funcref_table(wasm_rt_funcref_table_t* table) {
  std::free(table->data);
  *table = {};
}

}  // extern "C"
