#pragma once

#include "model/body.hpp"
#include "physics/wasm/instance.hpp"
#include "physics/wasm/vectors.hpp"

#include <havok.h>

#include <cstdint>

namespace subworld::havok {

using wasm::Float3;
using wasm::Float4;
using wasm::from_module;
using wasm::to_module;

using Handle = std::uint64_t;

// Layout in the module's memory (its embind descriptions list the offsets).
struct QTransform {
  Float3 translation;
  Float4 rotation;
};
struct Aabb {
  Float3 lower, upper;
};
struct MassProperties {
  Float3 centre;
  float mass;
  Float3 inertia_of_unit_mass;  ///< zero: does not rotate
  Float4 orientation;
};
struct Material {
  float static_friction, dynamic_friction, restitution;
  std::uint32_t friction_combine, restitution_combine;
};
struct ContactPoint {
  Handle body, shape, path_shape;
  std::uint64_t path;
  Float3 position, normal;
  std::uint32_t triangle, padding;
};
struct CollisionEvent {
  std::uint32_t type, padding;
  ContactPoint a, b;
  float impulse;
  std::uint32_t padding_end;
};
static_assert(sizeof(ContactPoint) == 64 && sizeof(CollisionEvent) == 144 && sizeof(MassProperties) == 44);

inline constexpr std::uint32_t kGeometricMean = 0, kMultiply = 4;
inline constexpr std::uint32_t kStatic = 1, kDynamic = 4;
inline constexpr std::uint32_t kAlwaysActive = 1;
inline constexpr std::uint32_t kStarted = 1, kContinued = 2;

/// A plane is represented by a box. In single precision a larger box, when tilted, would be wrong by micrometres.
inline constexpr double kPlaneSide_m = 100.0;

/// One instance of the module, with a memory of its own.
class Module : public wasm::EmscriptenInstance<w2c_havok, wasm2c_havok_free> {
 public:
  Module();

  [[nodiscard]] wasm::Address allocate(std::size_t bytes);
  void release(wasm::Address at);
};

/// Throws `Error` if `result` is not Havok's OK.
void check(std::uint32_t result, const char* what);

/// Disables Havok's drag for bodies that are made later. Havok brakes every body by 3 % of gravity so that heaps come
/// to rest, and no function disables it. The drag is a number in the motion properties that all bodies start from. Call
/// when gravity is set to zero. Throws `Error` if the number is not found.
void remove_drag(Module& module);

/// Makes a shape; `meshes` are the scene's. Throws `Error` if that fails.
[[nodiscard]] Handle make_shape(Module& module, const Shape& shape, std::span<const Mesh> meshes, double unit_m);

}  // namespace subworld::havok
