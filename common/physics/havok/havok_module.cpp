#include "physics/havok/havok_module.hpp"

#include "model/error.hpp"
#include "physics/adapter.hpp"

#include <fmt/core.h>

#include <array>

namespace subworld::havok {

namespace {

constexpr std::uint32_t kScratchBytes = 1024;

constexpr double kPlaneDepth_m = 10.0;

/// Copies an array to the module's memory.
template <class T>
wasm::Address upload(Module& module, const std::vector<T>& values) {
  const wasm::Address at = module.allocate(values.size() * sizeof(T));
  wasm::store_all(module.memory(), at, std::span<const T>(values));
  return at;
}

std::uint32_t make_box(Module& module, const Vec3& centre, const Vec3& half_extents, wasm::Scratch& scratch,
                       wasm::Address out) {
  return w2c_havok_HP_Shape_CreateBox(module.get(), scratch.put(to_module(centre)),
                                      scratch.put(to_module(Quat::Identity())),
                                      scratch.put(to_module(Vec3(2.0 * half_extents))), out);
}

std::uint32_t make_from_mesh(Module& module, const Shape& shape, std::span<const Mesh> meshes, wasm::Address out) {
  const Mesh& mesh = mesh_of(shape, meshes);
  const auto vertex_count = static_cast<std::uint32_t>(mesh.vertices.size());
  const wasm::Address corners = upload(module, to_module(mesh.vertices));
  std::uint32_t result = 0;
  if (shape.kind == ShapeKind::convex) {
    result = w2c_havok_HP_Shape_CreateConvexHull(module.get(), corners, vertex_count, out);
  } else {
    const wasm::Address triangles = upload(module, mesh.triangles);
    result = w2c_havok_HP_Shape_CreateMesh(module.get(), corners, vertex_count, triangles,
                                           static_cast<std::uint32_t>(mesh.triangles.size()), out);
    module.release(triangles);
  }
  module.release(corners);
  return result;
}

}  // namespace

Module::Module() {
  wasm2c_havok_instantiate(&module_, &env_, &wasi_);
  w2c_havok_0x5F_wasm_call_ctors(&module_);
  (void)w2c_havok_main(&module_, 0, 0);
  scratch_ = wasm::Scratch(module_.w2c_memory, allocate(kScratchBytes), kScratchBytes);
}

wasm::Address Module::allocate(std::size_t bytes) {
  const wasm::Address at = w2c_havok_malloc(&module_, static_cast<std::uint32_t>(bytes));
  if (at == 0) throw Error(ExitCode::failed, fmt::format("havok has no memory for {} more bytes", bytes));
  return at;
}

void Module::release(wasm::Address at) { w2c_havok_free(&module_, at); }

void check(std::uint32_t result, const char* what) {
  if (result != 0) throw Error(ExitCode::failed, fmt::format("havok: {} failed with {:#x}", what, result));
}

void remove_drag(Module& module) {
  // Motion properties, in words: largest speeds, two numbers, angular damping, the brake. They are found by their
  // default values.
  constexpr std::size_t kBrake = 5;
  constexpr std::uint32_t kSpeed = 0x43480000, kTurn = 0x42c80000, kDamping = 0x3dcccccd, kBrakeValue = 0x3e999999;
  constexpr std::uint64_t kSearched = 1U << 20;  // bytes; the properties are among a world's first allocations
  const wasm_rt_memory_t& memory = module.memory();
  int found = 0;
  std::array<std::uint32_t, kBrake + 1> words;
  for (std::uint64_t at = 0; at + sizeof words <= kSearched; at += sizeof(std::uint32_t)) {
    std::memcpy(words.data(), memory.data + at, sizeof words);
    if (words[0] != kSpeed || words[1] != kTurn || words[4] != kDamping || words[kBrake] != kBrakeValue) continue;
    wasm::store(memory, static_cast<wasm::Address>(at + kBrake * sizeof(std::uint32_t)), 0.0F);
    ++found;
  }
  if (found == 0) throw Error(ExitCode::failed, "havok: its motion properties are not where version 1.3.14 has them");
}

Handle make_shape(Module& module, const Shape& shape, std::span<const Mesh> meshes, double unit_m) {
  wasm::Scratch& scratch = module.scratch();
  const wasm::Address out = scratch.room<Handle>();
  const auto end = [&](double side) { return scratch.put(to_module(Vec3(0, 0, side * shape.half_length))); };
  const auto radius = static_cast<float>(shape.radius);
  std::uint32_t result = 1;
  switch (shape.kind) {
    case ShapeKind::sphere:
      result = w2c_havok_HP_Shape_CreateSphere(module.get(), scratch.put(to_module(Vec3::Zero())), radius, out);
      break;
    case ShapeKind::box:
      result = make_box(module, Vec3::Zero(), shape.half_extents, scratch, out);
      break;
    case ShapeKind::capsule:
      result = w2c_havok_HP_Shape_CreateCapsule(module.get(), end(-1.0), end(1.0), radius, out);
      break;
    case ShapeKind::cylinder:
      result = w2c_havok_HP_Shape_CreateCylinder(module.get(), end(-1.0), end(1.0), radius, out);
      break;
    case ShapeKind::plane:
      result = make_box(module, {0, 0, -0.5 * kPlaneDepth_m / unit_m},
                        0.5 / unit_m * Vec3(kPlaneSide_m, kPlaneSide_m, kPlaneDepth_m), scratch, out);
      break;
    case ShapeKind::convex:
    case ShapeKind::mesh:
    case ShapeKind::compound:  // refused before
      result = make_from_mesh(module, shape, meshes, out);
      break;
  }
  check(result, "making a shape");
  return scratch.get<Handle>(out);
}

}  // namespace subworld::havok
