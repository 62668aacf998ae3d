#pragma once

#include "physics/wasm/wasm-rt.h"

/// What Rapier imports of JavaScript, for one instance. The name is of the module's file, as wasm2c writes it.
struct w2c_0x2E0x2Frapier__wasm3d__bg0x2Ejs {
  const wasm_rt_memory_t* memory = nullptr;
};
