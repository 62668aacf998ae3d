#pragma once

#include "model/body.hpp"
#include "physics/wasm/host.hpp"
#include "physics/wasm/vectors.hpp"

#include <physx.h>

#include <cstdint>
#include <span>

namespace subworld::physx {

using wasm::Float3;
using wasm::Float4;
using wasm::from_module;
using wasm::to_module;

using wasm::Address;

// Layout in the module's memory.
struct Transform {
  Float4 rotation;
  Float3 translation;
};
struct Bounds {
  Float3 lower, upper;
};
struct ContactPoint {
  Float3 position;
  float separation;
  Float3 normal;  ///< from the second actor to the first
  std::uint32_t face_0;
  Float3 impulse;  ///< along the normal
  std::uint32_t face_1;
};
static_assert(sizeof(Transform) == 28 && sizeof(ContactPoint) == 48);

/// Receives the contacts of a step while it ends.
class ContactListener {
 public:
  /// `header` is a PxContactPairHeader, `pairs` an array of `count` PxContactPair.
  virtual void on_contact(Address header, Address pairs, std::uint32_t count) = 0;

 protected:
  ~ContactListener() = default;
};

/// One instance of the module, with its own memory, PhysX and scene. The scene has no gravity.
class Module {
 public:
  explicit Module(ContactListener& listener);
  ~Module();
  Module(const Module&) = delete;
  Module& operator=(const Module&) = delete;

  [[nodiscard]] w2c_physx* get() noexcept { return &module_; }
  [[nodiscard]] wasm_rt_memory_t& memory() noexcept { return module_.w2c_memory; }
  [[nodiscard]] wasm::Scratch& scratch() noexcept { return scratch_.reset(); }
  [[nodiscard]] Address physics() const noexcept { return physics_; }
  [[nodiscard]] Address scene() const noexcept { return scene_; }

  /// A shape with its own material. Throws `Error` if that fails.
  [[nodiscard]] Address make_shape(const Shape& shape, const Material& material, const wasm::Filter& filter,
                                   std::span<const Mesh> meshes);
  [[nodiscard]] Address allocate(std::size_t bytes);

 private:
  void make_scene();
  [[nodiscard]] Address make_geometry(const Shape& shape, std::span<const Mesh> meshes);
  [[nodiscard]] Address make_mesh_geometry(const Shape& shape, std::span<const Mesh> meshes);
  [[nodiscard]] std::uint32_t call(std::uint32_t code, Address arguments);

  ContactListener& listener_;
  w2c_physx module_{};
  w2c_env env_;
  w2c_wasi__snapshot__preview1 wasi_;
  wasm::Scratch scratch_;
  Address tolerances_ = 0;
  Address physics_ = 0;
  Address scene_ = 0;
  Address cooked_ = 0;  ///< the mesh of the latest geometry; its shapes hold a reference
};

}  // namespace subworld::physx
