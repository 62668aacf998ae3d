#include "physics/rapier/javascript.hpp"

#include "model/error.hpp"
#include "physics/wasm/host.hpp"

#include <fmt/core.h>

#include <string>

// Numbers represent JavaScript's objects: 0 is undefined; the module stores and passes the others without examining
// them. Results are read from the module's memory, so the functions that would return them are not needed. The names
// are wasm-bindgen's, with a hash of each declaration.

using Word = std::uint32_t;
using Imports = w2c_0x2E0x2Frapier__wasm3d__bg0x2Ejs;

#define IMPORT(name) w2c_0x2E0x2Frapier__wasm3d__bg0x2Ejs_##name

namespace {

constexpr Word kSomething = 1;

[[noreturn]] Word not_needed() {
  throw subworld::Error(subworld::ExitCode::failed,
                        "rapier calls a function outside its module, which version 0.20.0 does not");
}

}  // namespace

extern "C" {

/// Handles Rust's panics, with their message.
void IMPORT(0x5F_wbg_0x5F_wbindgen_throw_bb96b2010945f0bc)(Imports* imports, Word at, Word size) {
  const auto* text = reinterpret_cast<const char*>(subworld::wasm::inside(*imports->memory, at, size));
  throw subworld::Error(subworld::ExitCode::failed, fmt::format("rapier: {}", std::string(text, size)));
}

// Clock for the profiler. It is constant, because an engine must not depend on it.
Word IMPORT(0x5F_wbg_performance_3fcf6e32a7e1ed0a)(Imports*, Word) { return kSomething; }
double IMPORT(0x5F_wbg_now_e7c6795a7f81e10f)(Imports*, Word) { return 0.0; }
Word IMPORT(0x5F_wbg_static_accessor_GLOBAL_THIS_466428f93b4eaa76)(Imports*) { return kSomething; }
Word IMPORT(0x5F_wbg_static_accessor_GLOBAL_c7aea38d4de089bc)(Imports*) { return kSomething; }
Word IMPORT(0x5F_wbg_static_accessor_SELF_42d4fae05e59267a)(Imports*) { return kSomething; }
Word IMPORT(0x5F_wbg_static_accessor_WINDOW_e0db14a0eba6a812)(Imports*) { return kSomething; }

Word IMPORT(0x5F_wbg_0x5F_wbindgen_is_undefined_6cff064c44e0d823)(Imports*, Word value) { return value == 0; }
Word IMPORT(0x5F_wbindgen_object_clone_ref)(Imports*, Word object) { return object; }
void IMPORT(0x5F_wbindgen_object_drop_ref)(Imports*, Word) {}

Word IMPORT(0x5F_wbg_0x5F_wbindgen_boolean_get_c9c83ebd41b34df3)(Imports*, Word) { not_needed(); }
Word IMPORT(0x5F_wbg_0x5F_wbindgen_is_function_5e4570eb24ffa122)(Imports*, Word) { not_needed(); }
void IMPORT(0x5F_wbg_0x5F_wbindgen_number_get_136b9679cab35cfb)(Imports*, Word, Word) { not_needed(); }
Word IMPORT(0x5F_wbg_bind_f0a9af73583d6566)(Imports*, Word, Word, Word, Word) { not_needed(); }
Word IMPORT(0x5F_wbg_call_0f2a9af232c18fd2)(Imports*, Word, Word, Word, Word) { not_needed(); }
Word IMPORT(0x5F_wbg_call_35dba3c747ad7521)(Imports*, Word, Word, Word) { not_needed(); }
Word IMPORT(0x5F_wbg_call_39f824e18d9d2414)(Imports*, Word, Word, Word, Word, Word) { not_needed(); }
Word IMPORT(0x5F_wbg_length_1009454859bb3e03)(Imports*, Word) { not_needed(); }
Word IMPORT(0x5F_wbg_length_36bd29c6848c2144)(Imports*, Word) { not_needed(); }
Word IMPORT(0x5F_wbg_new_from_slice_3eea173078478cfe)(Imports*, Word, Word) { not_needed(); }
Word IMPORT(0x5F_wbg_new_with_length_ef112d2291d8ab95)(Imports*, Word) { not_needed(); }
void IMPORT(0x5F_wbg_prototypesetcall_de8e0d9553586985)(Imports*, Word, Word, Word) { not_needed(); }
Word IMPORT(0x5F_wbg_rawcontactforceevent_new)(Imports*, Word) { not_needed(); }
Word IMPORT(0x5F_wbg_rawraycolliderintersection_new)(Imports*, Word) { not_needed(); }
Word IMPORT(0x5F_wbg_rawshape_unwrap)(Imports*, Word) { not_needed(); }
void IMPORT(0x5F_wbg_set_577f5f7485b6744e)(Imports*, Word, Word, Word) { not_needed(); }
void IMPORT(0x5F_wbg_set_index_aac0f95bd3ef91b6)(Imports*, Word, Word, float) { not_needed(); }
Word IMPORT(0x5F_wbindgen_cast_0000000000000001)(Imports*, double) { not_needed(); }

}  // extern "C"
