#include "model/error.hpp"
#include "physics/wasm/wasm-rt.h"

#include <fmt/format.h>

#include <sys/mman.h>

#include <cstdlib>
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
      return "conversion of a number that is none";
    case WASM_RT_TRAP_UNREACHABLE:
      return "it gave up (unreachable)";
    case WASM_RT_TRAP_CALL_INDIRECT:
      return "indirect call of no function or of another type";
    case WASM_RT_TRAP_EXHAUSTION:
      return "calls nested too deeply";
    case WASM_RT_TRAP_NONE:
      break;
  }
  return "unknown trap";
}

[[noreturn]] void no_memory(std::uint64_t bytes) {
  throw subworld::Error(subworld::ExitCode::failed,
                        fmt::format("no address space for an engine of {} MiB; end other programs or raise the limit "
                                    "(ulimit -v)",
                                    bytes >> 20));
}

}  // namespace

extern "C" {

__thread std::uint32_t wasm_rt_call_stack_depth = 0;

void wasm_rt_trap(wasm_rt_trap_t trap) {
  wasm_rt_call_stack_depth = 0;  // unwinding skips the epilogues that count it down
  throw subworld::Error(subworld::ExitCode::failed, fmt::format("the engine's wasm code stopped: {}", reason(trap)));
}

void wasm_rt_allocate_memory(wasm_rt_memory_t* memory, std::uint64_t pages, std::uint64_t max_pages, bool,
                             std::uint32_t) {
  *memory = {};
  const std::uint64_t reserved = max_pages * kPage;
  // Only what is in use may be touched: a process that locks its memory would fill and lock the whole reservation.
  void* base = mmap(nullptr, reserved, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (base == MAP_FAILED) no_memory(reserved);
  if (mprotect(base, pages * kPage, PROT_READ | PROT_WRITE) != 0) no_memory(pages * kPage);
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
  if (memory->data) munmap(memory->data, memory->max_pages * kPage);
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
