#include "physics/wasm/host.hpp"

// Imports that several modules share. Modules write messages only before they abort: the messages are dropped, and the
// following trap is reported.

extern "C" {

void w2c_env_0x5Fabort_js(w2c_env*) { wasm_rt_trap(WASM_RT_TRAP_UNREACHABLE); }
void w2c_env_exit(w2c_env*, std::uint32_t) { wasm_rt_trap(WASM_RT_TRAP_UNREACHABLE); }

std::uint32_t w2c_env_emscripten_asm_const_int(w2c_env* env, std::uint32_t code, std::uint32_t signature,
                                               std::uint32_t arguments) {
  if (!env->call_out) wasm_rt_trap(WASM_RT_TRAP_UNREACHABLE);
  return env->call_out(env->owner, code, signature, arguments);
}
double w2c_env_emscripten_asm_const_double(w2c_env*, std::uint32_t, std::uint32_t, std::uint32_t) {
  wasm_rt_trap(WASM_RT_TRAP_UNREACHABLE);
}

double w2c_env_emscripten_get_now(w2c_env*) { return 0.0; }
double w2c_env_emscripten_date_now(w2c_env*) { return 0.0; }
std::uint32_t w2c_env_0x5Femscripten_get_now_is_monotonic(w2c_env*) { return 1; }

std::uint32_t w2c_env_emscripten_get_heap_max(w2c_env* env) {
  return static_cast<std::uint32_t>(env->memory->max_pages * 65536);
}

std::uint32_t w2c_env_emscripten_resize_heap(w2c_env* env, std::uint32_t bytes) {
  const std::uint64_t wanted = (std::uint64_t{bytes} + 65535) / 65536;
  if (wanted <= env->memory->pages) return 1;
  return wasm_rt_grow_memory(env->memory, wanted - env->memory->pages) != UINT32_MAX;
}

std::uint32_t w2c_wasi__snapshot__preview1_clock_time_get(w2c_wasi__snapshot__preview1*, std::uint32_t, std::uint64_t,
                                                          std::uint32_t) {
  constexpr std::uint32_t kNotSupported = 58;  // errno of WASI
  return kNotSupported;
}
std::uint32_t w2c_wasi__snapshot__preview1_fd_close(w2c_wasi__snapshot__preview1*, std::uint32_t) { return 0; }
std::uint32_t w2c_wasi__snapshot__preview1_fd_seek(w2c_wasi__snapshot__preview1*, std::uint32_t, std::uint64_t,
                                                   std::uint32_t, std::uint32_t) {
  return 0;
}
std::uint32_t w2c_wasi__snapshot__preview1_fd_write(w2c_wasi__snapshot__preview1*, std::uint32_t, std::uint32_t,
                                                    std::uint32_t, std::uint32_t) {
  constexpr std::uint32_t kBadFile = 8;  // errno of WASI
  return kBadFile;
}

}  // extern "C"
