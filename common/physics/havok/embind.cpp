#include "physics/wasm/host.hpp"

#include <cstdint>

// Havok describes its interface to JavaScript while it starts. It also exports all needed functions as plain ones, so
// the descriptions are ignored.

using Word = std::uint32_t;

extern "C" {

void w2c_env_0x5Fembind_finalize_value_array(w2c_env*, Word) {}
void w2c_env_0x5Fembind_register_bigint(w2c_env*, Word, Word, Word, std::uint64_t, std::uint64_t) {}
void w2c_env_0x5Fembind_register_bool(w2c_env*, Word, Word, Word, Word) {}
void w2c_env_0x5Fembind_register_emval(w2c_env*, Word) {}
void w2c_env_0x5Fembind_register_enum(w2c_env*, Word, Word, Word, Word) {}
void w2c_env_0x5Fembind_register_enum_value(w2c_env*, Word, Word, Word) {}
void w2c_env_0x5Fembind_register_float(w2c_env*, Word, Word, Word) {}
void w2c_env_0x5Fembind_register_function(w2c_env*, Word, Word, Word, Word, Word, Word, Word, Word) {}
void w2c_env_0x5Fembind_register_integer(w2c_env*, Word, Word, Word, Word, Word) {}
void w2c_env_0x5Fembind_register_memory_view(w2c_env*, Word, Word, Word) {}
void w2c_env_0x5Fembind_register_std_string(w2c_env*, Word, Word) {}
void w2c_env_0x5Fembind_register_std_wstring(w2c_env*, Word, Word, Word) {}
void w2c_env_0x5Fembind_register_value_array(w2c_env*, Word, Word, Word, Word, Word, Word) {}
void w2c_env_0x5Fembind_register_value_array_element(w2c_env*, Word, Word, Word, Word, Word, Word, Word, Word, Word) {}
void w2c_env_0x5Fembind_register_void(w2c_env*, Word, Word) {}
double w2c_env_0x5Femval_call_method(w2c_env*, Word, Word, Word, Word, Word) { return 0.0; }
void w2c_env_0x5Femval_decref(w2c_env*, Word) {}
Word w2c_env_0x5Femval_get_method_caller(w2c_env*, Word, Word, Word) { return 0; }
void w2c_env_0x5Femval_run_destructors(w2c_env*, Word) {}

}  // extern "C"
