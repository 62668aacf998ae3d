#pragma once

#include "model/body.hpp"
#include "physics/adapter.hpp"
#include "physics/wasm/instance.hpp"
#include "physics/wasm/vectors.hpp"

#include <physx.h>

#include <cstdint>
#include <span>
#include <vector>

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

/// A contact point of two actors, by their user data.
struct Report {
  std::uint32_t first, second;
  ContactPoint point;
};

/// One instance of the module, with its own memory, PhysX and scene. The scene has no gravity.
class Module : public wasm::EmscriptenInstance<w2c_physx, wasm2c_physx_free> {
 public:
  Module();

  [[nodiscard]] Address physics() const noexcept { return physics_; }
  [[nodiscard]] Address scene() const noexcept { return scene_; }

  /// A shape with its own material. Throws `Error` if that fails.
  [[nodiscard]] Address make_shape(const Shape& shape, const Material& material, const CollisionClass& collides,
                                   std::span<const Mesh> meshes);
  /// Advances the scene by h (s).
  void step(double h);
  /// Contacts of the last step, found before the velocities at its end were known.
  [[nodiscard]] std::span<const Report> reports() const noexcept { return reports_; }

  template <class T>
  [[nodiscard]] T get_at(Address at) const {
    return wasm::load<T>(module_.w2c_memory, at);
  }

 private:
  [[nodiscard]] Address allocate(std::size_t bytes);
  void make_scene();
  [[nodiscard]] Address make_geometry(const Shape& shape, std::span<const Mesh> meshes);
  [[nodiscard]] Address make_mesh_geometry(const Shape& shape, std::span<const Mesh> meshes);
  [[nodiscard]] std::uint32_t call(std::uint32_t code, Address arguments);
  /// `header` is a PxContactPairHeader, `pairs` an array of `count` PxContactPair.
  void on_contact(Address header, Address pairs, std::uint32_t count);

  Address tolerances_ = 0;
  Address physics_ = 0;
  Address scene_ = 0;
  Address cooked_ = 0;  ///< the mesh of the latest geometry; its shapes hold a reference
  Address points_ = 0;  ///< memory for the contact points of a pair
  std::vector<Report> reports_;
};

}  // namespace subworld::physx
