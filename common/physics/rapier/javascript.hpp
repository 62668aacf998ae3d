#pragma once

#include "physics/wasm/wasm-rt.h"

/// JavaScript imports of Rapier, for one instance. wasm2c derives the name from the file of the module.
struct w2c_0x2E0x2Frapier__wasm3d__bg0x2Ejs {
  const wasm_rt_memory_t* memory = nullptr;
};
