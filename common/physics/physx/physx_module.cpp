#include "physics/physx/physx_module.hpp"

#include "model/error.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace subworld::physx {

namespace {

constexpr std::uint32_t kScratchBytes = 4096;

/// Of one pair; further points are not read.
constexpr std::uint32_t kMostPoints = 64;

/// Typical size and speed of the simulated bodies, from which PhysX derives thresholds and contact distances.
constexpr float kLength = 0.1F;  ///< m
constexpr float kSpeed = 1.0F;   ///< m/s

/// Slower impacts do not bounce, m/s.
constexpr float kBounceThreshold = 0.05F;

// A call out of the module passes the address of a piece of JavaScript (of version 2.7.3); these occur.
constexpr std::uint32_t kFilterCode = 270506;
constexpr std::uint32_t kContactCode = 273574;

// Pairs are detected and solved, and reported with their points when contact begins and while it lasts.
constexpr std::uint32_t kPairFlags = 1U | 1U << 2 | 1U << 3 | 1U << 9 | 1U << 10;
constexpr std::uint32_t kKillPair = 1;

constexpr std::uint32_t kMultiply = 2;  ///< PxCombineMode
constexpr std::uint32_t kSolverTgs = 1;
/// PxSceneFlag::eENABLE_EXTERNAL_FORCES_EVERY_ITERATION_TGS, which the module does not name. Without it the first
/// iteration of TGS has the whole step's weight, and bodies held by friction tremble and creep.
constexpr std::uint32_t kForcesEveryIteration = 1U << 16;
constexpr std::uint32_t kShapeFlags = 1;  ///< takes part in the simulation, not in queries
constexpr std::uint32_t kComputeConvex = 1U << 1;

Address need(Address made, const char* what) {
  if (made == 0) throw Error(ExitCode::failed, fmt::format("physx: making {} failed", what));
  return made;
}

/// Rotates PhysX's axis x of planes, capsules and cylinders to z.
const Transform kAlongZ{{0.0F, -std::sqrt(0.5F), 0.0F, std::sqrt(0.5F)}, {}};

}  // namespace

Module::Module() {
  env_.owner = this;
  env_.call_out = [](void* owner, std::uint32_t code, std::uint32_t, std::uint32_t arguments) {
    return static_cast<Module*>(owner)->call(code, arguments);
  };
  wasm2c_physx_instantiate(&module_, &env_, &wasi_);
  w2c_physx_0x5F_wasm_call_ctors(&module_);
  scratch_ = wasm::Scratch(module_.w2c_memory, allocate(kScratchBytes), kScratchBytes);
  make_scene();
  points_ = allocate(kMostPoints * sizeof(ContactPoint));
}

void Module::step(double h) {
  reports_.clear();
  w2c_physx_emscripten_bind_PxScene_simulate_1(&module_, scene_, static_cast<float>(h));
  if (w2c_physx_emscripten_bind_PxScene_fetchResults_1(&module_, scene_, 1) == 0) {
    throw Error(ExitCode::failed, "physx: a step did not end");
  }
}

void Module::on_contact(Address header, Address pairs, std::uint32_t count) {
  w2c_physx* m = &module_;
  const auto id = [&](std::uint32_t i) {
    return w2c_physx_emscripten_bind_PxActor_get_userData_0(
        m, w2c_physx_emscripten_bind_PxContactPairHeader_get_actors_1(m, header, i));
  };
  const std::uint32_t first = id(0), second = id(1);
  for (std::uint32_t i = 0; i < count; ++i) {
    const Address pair = w2c_physx_emscripten_bind_NativeArrayHelpers_getContactPairAt_2(m, pairs, i);
    const std::uint32_t points =
        w2c_physx_emscripten_bind_PxContactPair_extractContacts_2(m, pair, points_, kMostPoints);
    for (std::uint32_t p = 0; p < points; ++p) {
      reports_.push_back(
          {first, second, get_at<ContactPoint>(static_cast<Address>(points_ + p * sizeof(ContactPoint)))});
    }
  }
}

Address Module::allocate(std::size_t bytes) {
  return need(w2c_physx_malloc(&module_, static_cast<std::uint32_t>(bytes)), "room in memory");
}

void Module::make_scene() {
  w2c_physx* m = &module_;
  const std::uint32_t version = w2c_physx_emscripten_bind_PxTopLevelFunctions_get_PHYSICS_VERSION_0(m, 0);
  const Address foundation = need(w2c_physx_emscripten_bind_PxTopLevelFunctions_CreateFoundation_3(
                                      m, version, w2c_physx_emscripten_bind_PxDefaultAllocator_PxDefaultAllocator_0(m),
                                      w2c_physx_emscripten_bind_PxDefaultErrorCallback_PxDefaultErrorCallback_0(m)),
                                  "a foundation");
  tolerances_ = need(w2c_physx_emscripten_bind_PxTolerancesScale_PxTolerancesScale_0(m), "tolerances");
  w2c_physx_emscripten_bind_PxTolerancesScale_set_length_1(m, tolerances_, kLength);
  w2c_physx_emscripten_bind_PxTolerancesScale_set_speed_1(m, tolerances_, kSpeed);
  physics_ = need(w2c_physx_emscripten_bind_PxTopLevelFunctions_CreatePhysics_3(m, version, foundation, tolerances_),
                  "a physics");

  const Address description = need(w2c_physx_emscripten_bind_PxSceneDesc_PxSceneDesc_1(m, tolerances_), "a scene");
  w2c_physx_emscripten_bind_PxSceneDesc_set_cpuDispatcher_1(
      m, description, w2c_physx_emscripten_bind_PxTopLevelFunctions_DefaultCpuDispatcherCreate_1(m, 0));
  const Address events = w2c_physx_emscripten_bind_PxSimulationEventCallbackImpl_PxSimulationEventCallbackImpl_0(m);
  w2c_physx_emscripten_bind_PxSceneDesc_set_simulationEventCallback_1(m, description, events);
  w2c_physx_emscripten_bind_PxSceneDesc_set_solverType_1(m, description, kSolverTgs);
  w2c_physx_emscripten_bind_PxSceneDesc_set_bounceThresholdVelocity_1(m, description, kBounceThreshold);
  const Address flags = w2c_physx_emscripten_bind_PxSceneDesc_get_flags_0(m, description);
  w2c_physx_emscripten_bind_PxSceneFlags_raise_1(
      m, flags, w2c_physx_emscripten_enum_PxSceneFlagEnum_eENABLE_FRICTION_EVERY_ITERATION(m));
  w2c_physx_emscripten_bind_PxSceneFlags_raise_1(
      m, flags, w2c_physx_emscripten_enum_PxSceneFlagEnum_eENABLE_ENHANCED_DETERMINISM(m));
  w2c_physx_emscripten_bind_PxSceneFlags_raise_1(m, flags, kForcesEveryIteration);
  const Address filter = w2c_physx_emscripten_bind_PassThroughFilterShaderImpl_PassThroughFilterShaderImpl_0(m);
  w2c_physx_emscripten_bind_PxTopLevelFunctions_setupPassThroughFilterShader_2(m, description, filter);
  scene_ = need(w2c_physx_emscripten_bind_PxPhysics_createScene_1(m, physics_, description), "a scene");
}

std::uint32_t Module::call(std::uint32_t code, Address arguments) {
  // Arguments are consecutive; in these calls, all have 4 bytes.
  const auto argument = [&](std::uint32_t i) { return wasm::load<std::uint32_t>(memory(), arguments + 4 * i); };
  if (code == kContactCode) {
    on_contact(argument(1), argument(2), argument(3));
    return 0;
  }
  if (code == kFilterCode) {
    // The module resets the flags before each call.
    w2c_physx_emscripten_bind_PassThroughFilterShader_set_outputPairFlags_1(&module_, argument(0), kPairFlags);
    // For each actor: attributes, then the four words of its filter data.
    const CollisionClass first{argument(2), argument(3)}, second{argument(7), argument(8)};
    return (first.member & second.meets) != 0 && (second.member & first.meets) != 0 ? 0 : kKillPair;
  }
  throw Error(ExitCode::failed, fmt::format("physx makes the call {}, which version 2.7.3 does not make", code));
}

Address Module::make_mesh_geometry(const Shape& shape, std::span<const Mesh> meshes) {
  const Mesh& mesh = mesh_of(shape, meshes);
  w2c_physx* m = &module_;
  const auto describe = [&](Address data, Address at, std::size_t count, std::size_t stride) {
    w2c_physx_emscripten_bind_PxBoundedData_set_count_1(m, data, static_cast<std::uint32_t>(count));
    w2c_physx_emscripten_bind_PxBoundedData_set_stride_1(m, data, static_cast<std::uint32_t>(stride));
    w2c_physx_emscripten_bind_PxBoundedData_set_data_1(m, data, at);
  };
  const Address vertices = allocate(mesh.vertices.size() * sizeof(Float3));
  wasm::store_all<Float3>(memory(), vertices, to_module(mesh.vertices));
  const Address cooking = w2c_physx_emscripten_bind_PxCookingParams_PxCookingParams_1(m, tolerances_);
  if (shape.kind == ShapeKind::convex) {
    const Address description = w2c_physx_emscripten_bind_PxConvexMeshDesc_PxConvexMeshDesc_0(m);
    describe(w2c_physx_emscripten_bind_PxConvexMeshDesc_get_points_0(m, description), vertices, mesh.vertices.size(),
             sizeof(Float3));
    w2c_physx_emscripten_bind_PxConvexMeshDesc_set_flags_1(
        m, description, w2c_physx_emscripten_bind_PxConvexFlags_PxConvexFlags_1(m, kComputeConvex));
    const Address hull = need(w2c_physx_emscripten_bind_PxTopLevelFunctions_CreateConvexMesh_2(m, cooking, description),
                              "a convex hull");
    w2c_physx_webidl_free(m, vertices);
    cooked_ = hull;
    return w2c_physx_emscripten_bind_PxConvexMeshGeometry_PxConvexMeshGeometry_1(m, hull);
  }
  const Address triangles = allocate(mesh.triangles.size() * sizeof mesh.triangles[0]);
  wasm::store_all(memory(), triangles, std::span(mesh.triangles));
  const Address description = w2c_physx_emscripten_bind_PxTriangleMeshDesc_PxTriangleMeshDesc_0(m);
  describe(w2c_physx_emscripten_bind_PxTriangleMeshDesc_get_points_0(m, description), vertices, mesh.vertices.size(),
           sizeof(Float3));
  describe(w2c_physx_emscripten_bind_PxTriangleMeshDesc_get_triangles_0(m, description), triangles,
           mesh.triangles.size(), sizeof mesh.triangles[0]);
  const Address made =
      need(w2c_physx_emscripten_bind_PxTopLevelFunctions_CreateTriangleMesh_2(m, cooking, description), "a mesh");
  w2c_physx_webidl_free(m, vertices);
  w2c_physx_webidl_free(m, triangles);
  cooked_ = made;
  return w2c_physx_emscripten_bind_PxTriangleMeshGeometry_PxTriangleMeshGeometry_1(m, made);
}

Address Module::make_geometry(const Shape& shape, std::span<const Mesh> meshes) {
  w2c_physx* m = &module_;
  const auto radius = static_cast<float>(shape.radius);
  const auto half_length = static_cast<float>(shape.half_length);
  const Float3 half = to_module(shape.half_extents);
  switch (shape.kind) {
    case ShapeKind::sphere:
      return w2c_physx_emscripten_bind_PxSphereGeometry_PxSphereGeometry_1(m, radius);
    case ShapeKind::box:
      return w2c_physx_emscripten_bind_PxBoxGeometry_PxBoxGeometry_3(m, half.x, half.y, half.z);
    case ShapeKind::capsule:
      return w2c_physx_emscripten_bind_PxCapsuleGeometry_PxCapsuleGeometry_2(m, radius, half_length);
    case ShapeKind::cylinder:
      return w2c_physx_emscripten_bind_PxConvexCoreGeometryFactory_createFromCylinder_2(
          m, w2c_physx_emscripten_bind_PxConvexCoreCylinder_PxConvexCoreCylinder_2(m, 2.0F * half_length, radius),
          0.0F);
    case ShapeKind::plane:
      return w2c_physx_emscripten_bind_PxPlaneGeometry_PxPlaneGeometry_0(m);
    case ShapeKind::convex:
    case ShapeKind::mesh:
      return make_mesh_geometry(shape, meshes);
    case ShapeKind::compound:  // refused before
      break;
  }
  throw Error(ExitCode::usage, "physx does not know this kind of shape");
}

Address Module::make_shape(const Shape& shape, const Material& material, const CollisionClass& collides,
                           std::span<const Mesh> meshes) {
  w2c_physx* m = &module_;
  cooked_ = 0;
  const Address geometry = need(make_geometry(shape, meshes), "a geometry");
  // PhysX multiplies the values of a pair: the root of the friction gives the geometric mean.
  const auto friction = static_cast<float>(std::sqrt(material.friction));
  const Address surface = need(w2c_physx_emscripten_bind_PxPhysics_createMaterial_3(
                                   m, physics_, friction, friction, static_cast<float>(material.restitution)),
                               "a material");
  w2c_physx_emscripten_bind_PxMaterial_setFrictionCombineMode_1(m, surface, kMultiply);
  w2c_physx_emscripten_bind_PxMaterial_setRestitutionCombineMode_1(m, surface, kMultiply);
  const Address flags = w2c_physx_emscripten_bind_PxShapeFlags_PxShapeFlags_1(m, kShapeFlags);
  const Address made =
      need(w2c_physx_emscripten_bind_PxPhysics_createShape_4(m, physics_, geometry, surface, 1, flags), "a shape");
  w2c_physx_emscripten_bind_PxMaterial_release_0(m, surface);
  if (cooked_ != 0) w2c_physx_emscripten_bind_PxRefCounted_release_0(m, cooked_);
  w2c_physx_webidl_free(m, geometry);
  w2c_physx_webidl_free(m, flags);
  const Address words = w2c_physx_emscripten_bind_PxFilterData_PxFilterData_4(m, collides.member, collides.meets, 0, 0);
  w2c_physx_emscripten_bind_PxShape_setSimulationFilterData_1(m, made, words);
  w2c_physx_webidl_free(m, words);
  if (shape.kind == ShapeKind::plane || shape.kind == ShapeKind::capsule || shape.kind == ShapeKind::cylinder) {
    w2c_physx_emscripten_bind_PxShape_setLocalPose_1(m, made, scratch().put(kAlongZ));
  }
  return made;
}

}  // namespace subworld::physx
