#pragma once

#include "physics/wasm/host.hpp"

namespace subworld::wasm {

/// One instance of a module, with its own memory. `Code` and `kFree` are those that wasm2c writes.
template <class Code, void (*kFree)(Code*)>
class Instance {
 public:
  Instance(const Instance&) = delete;
  Instance& operator=(const Instance&) = delete;

  [[nodiscard]] Code* get() noexcept { return &module_; }
  [[nodiscard]] wasm_rt_memory_t& memory() noexcept { return module_.w2c_memory; }

 protected:
  Instance() = default;
  ~Instance() { kFree(&module_); }

  Code module_{};
};

/// An instance of a module that Emscripten made.
template <class Code, void (*kFree)(Code*)>
class EmscriptenInstance : public Instance<Code, kFree> {
 public:
  /// Range for the arguments and results of the next calls.
  [[nodiscard]] Scratch& scratch() noexcept { return scratch_.reset(); }

 protected:
  EmscriptenInstance() { env_.memory = &this->module_.w2c_memory; }

  w2c_env env_;
  w2c_wasi__snapshot__preview1 wasi_;
  Scratch scratch_;
};

}  // namespace subworld::wasm
