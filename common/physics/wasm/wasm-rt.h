#pragma once

// Host interface of the C code that wasm2c writes (name and contents are those of wabt 1.0.39). Every access to memory
// and every indirect call is checked. A trap is a C++ exception that unwinds through the C frames, which are compiled
// with -fexceptions. One instance may run on one thread at a time; instances share nothing.
//
// Where the processor supports it, the hardware checks accesses to memory: the range that an address and an offset of
// 32 bits can reach is reserved for each instance, and a fault there becomes the trap.

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef __cplusplus
extern "C" {
#endif

#define LIKELY(x) __builtin_expect(!!(x), 1)
#define UNLIKELY(x) __builtin_expect(!!(x), 0)

#define WABT_BIG_ENDIAN 0
#if defined(__x86_64__) && defined(__linux__)
#define WASM_RT_MEMCHECK_GUARD_PAGES 1
#else
#define WASM_RT_MEMCHECK_GUARD_PAGES 0
#endif
#define WASM_RT_USE_SEGUE 0
#define WASM_RT_SANITY_CHECKS 0
#define WASM_RT_STACK_DEPTH_COUNT 1
#define WASM_RT_MAX_CALL_STACK_DEPTH 2000
#define wasm_rt_memcpy memcpy

typedef enum {
  WASM_RT_TRAP_NONE,
  WASM_RT_TRAP_OOB,
  WASM_RT_TRAP_INT_OVERFLOW,
  WASM_RT_TRAP_DIV_BY_ZERO,
  WASM_RT_TRAP_INVALID_CONVERSION,
  WASM_RT_TRAP_UNREACHABLE,
  WASM_RT_TRAP_CALL_INDIRECT,
  WASM_RT_TRAP_EXHAUSTION,
} wasm_rt_trap_t;

typedef enum { WASM_RT_I32, WASM_RT_I64, WASM_RT_F32, WASM_RT_F64, WASM_RT_V128 } wasm_rt_type_t;

typedef void (*wasm_rt_function_ptr_t)(void);

/// A name of 32 bytes that is shared by equal function types.
typedef const char* wasm_rt_func_type_t;

/// Tail calls are not used, but the generated tables have a column for them.
typedef struct {
  void (*fn)(void** instance, void* stack, void* next);
} wasm_rt_tailcallee_t;

typedef struct {
  wasm_rt_func_type_t func_type;
  wasm_rt_function_ptr_t func;
  wasm_rt_tailcallee_t func_tailcallee;
  void* module_instance;
} wasm_rt_funcref_t;

typedef void* wasm_rt_externref_t;

static const wasm_rt_funcref_t wasm_rt_funcref_null_value = {0, 0, {0}, 0};
static const wasm_rt_externref_t wasm_rt_externref_null_value = 0;

typedef struct {
  uint8_t* data;
  uint64_t pages, max_pages;  ///< of 64 KiB
  uint64_t size;              ///< bytes that the module may use; the reserved range is at least that of `max_pages`
} wasm_rt_memory_t;

typedef struct {
  wasm_rt_funcref_t* data;
  uint32_t max_size;
  uint32_t size;
} wasm_rt_funcref_table_t;

typedef struct {
  wasm_rt_externref_t* data;
  uint32_t max_size;
  uint32_t size;
} wasm_rt_externref_table_t;

/// Depth of wasm calls on this thread. This TLS model gives plain accesses, also in a library that is opened at run
/// time.
extern __thread uint32_t wasm_rt_call_stack_depth __attribute__((tls_model("initial-exec")));

/// Throws `subworld::Error`.
__attribute__((noreturn, cold)) void wasm_rt_trap(wasm_rt_trap_t trap);

static inline bool wasm_rt_is_initialized(void) { return true; }

/// Reserves address space for `max_pages`; memory is allocated when it is written. Throws `subworld::Error` if there is
/// not enough space.
void wasm_rt_allocate_memory(wasm_rt_memory_t* memory, uint64_t pages, uint64_t max_pages, bool is64, uint32_t page);
/// Returns the previous number of pages, or UINT32_MAX if the memory would get too large.
uint64_t wasm_rt_grow_memory(wasm_rt_memory_t* memory, uint64_t pages);
void wasm_rt_free_memory(wasm_rt_memory_t* memory);

void wasm_rt_allocate_funcref_table(wasm_rt_funcref_table_t* table, uint32_t size, uint32_t max_size);
void wasm_rt_free_funcref_table(wasm_rt_funcref_table_t* table);

#ifdef __cplusplus
}
#endif
