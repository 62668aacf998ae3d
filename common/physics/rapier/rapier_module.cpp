#include "physics/rapier/rapier_module.hpp"

#include "model/error.hpp"

#include <cmath>
#include <vector>

namespace subworld::rapier {

namespace {

// Offsets of the arrays' addresses in the objects.
constexpr Address kBodies = 472;
constexpr Address kPairs = 20, kPairCount = 24;

constexpr std::uint32_t kMultiply = 2;  ///< CoefficientCombineRule
constexpr std::uint32_t kFixed = 1, kDynamic = 0;
constexpr std::uint32_t kDefaultPairs = 15;            ///< ActiveCollisionTypes
constexpr std::uint32_t kFixInternalEdges = 128 + 16;  ///< TriMeshFlags
constexpr std::uint32_t kAlign = 4;

/// Rotates the axis y of capsules and cylinders to z.
const Quat kAlongZ = Quat(std::sqrt(0.5), std::sqrt(0.5), 0.0, 0.0);

}  // namespace

Module::Module() {
  javascript_.memory = &module_.w2c_memory;
  wasm2c_rapier_instantiate(&module_, &javascript_);
  w2c_rapier* m = &module_;
  parameters_ = w2c_rapier_rawintegrationparameters_new(m);
  pipeline_ = w2c_rapier_rawphysicspipeline_new(m);
  islands_ = w2c_rapier_rawislandmanager_new(m);
  broad_phase_ = w2c_rapier_rawbroadphase_new(m);
  narrow_phase_ = w2c_rapier_rawnarrowphase_new(m);
  bodies_ = w2c_rapier_rawrigidbodyset_new(m);
  colliders_ = w2c_rapier_rawcolliderset_new(m);
  joints_ = w2c_rapier_rawimpulsejointset_new(m);
  multibody_joints_ = w2c_rapier_rawmultibodyjointset_new(m);
  ccd_ = w2c_rapier_rawccdsolver_new(m);
  for (Address& vector : vectors_) vector = w2c_rapier_rawvector_new(m, 0.0F, 0.0F, 0.0F);
  zero_ = w2c_rapier_rawvector_new(m, 0.0F, 0.0F, 0.0F);
  unturned_ = w2c_rapier_rawrotation_new(m, 0.0F, 0.0F, 0.0F, 1.0F);
}

Address Module::put(Address vector, const Vec3& v) {
  w2c_rapier_rawvector_set_x(&module_, vector, static_cast<float>(v.x()));
  w2c_rapier_rawvector_set_y(&module_, vector, static_cast<float>(v.y()));
  w2c_rapier_rawvector_set_z(&module_, vector, static_cast<float>(v.z()));
  return vector;
}

RigidBody& Module::body(Handle handle) {
  const auto first = wasm::load<Address>(memory(), bodies_ + kBodies);
  return *at<RigidBody>(first + index_of(handle) * static_cast<Address>(sizeof(RigidBody)));
}

std::span<const ContactPair> Module::pairs() {
  return view<ContactPair>({0, wasm::load<Address>(memory(), narrow_phase_ + kPairs),
                            wasm::load<std::uint32_t>(memory(), narrow_phase_ + kPairCount)});
}

Handle Module::make_body(const Body& body, const BodyState& state, Address shape, const CollisionClass& collides) {
  w2c_rapier* m = &module_;
  const Float4 q = to_module(state.orientation);
  const Address rotation = w2c_rapier_rawrotation_new(m, q.x, q.y, q.z, q.w);
  const Handle made = w2c_rapier_rawrigidbodyset_createRigidBody(
      m, bodies_, 1, first(state.position), rotation, 0.0F, 0.0F, 0, zero_, zero_, zero_, zero_, unturned_, 1, 1, 1, 1,
      1, 1, 0.0F, 0.0F, body.fixed() ? kFixed : kDynamic, 0, 0, 0.0F, 0, 0, 0);
  w2c_rapier_0x5F_wbg_rawrotation_free(m, rotation, 0);
  this->body(made).gyroscopic_torque = 0;  // the adapter's own is exact
  make_collider(made, body, shape, collides);
  return made;
}

template <class T>
Address Module::copy(std::span<const T> values) {
  const Address to =
      w2c_rapier_0x5F_wbindgen_export3(&module_, static_cast<std::uint32_t>(values.size_bytes()), kAlign);
  wasm::store_all(memory(), to, values);
  return to;
}

Address Module::make_geometry(const Shape& shape, std::span<const Mesh> meshes) {
  w2c_rapier* m = &module_;
  const auto radius = static_cast<float>(shape.radius);
  const auto half_length = static_cast<float>(shape.half_length);
  switch (shape.kind) {
    case ShapeKind::sphere:
      return w2c_rapier_rawshape_ball(m, radius);
    case ShapeKind::box: {
      const Float3 half = to_module(shape.half_extents);
      return w2c_rapier_rawshape_cuboid(m, half.x, half.y, half.z);
    }
    case ShapeKind::capsule:
      return w2c_rapier_rawshape_capsule(m, half_length, radius);
    case ShapeKind::cylinder:
      return w2c_rapier_rawshape_cylinder(m, half_length, radius);
    case ShapeKind::plane:
      return w2c_rapier_rawshape_halfspace(m, first(Vec3::UnitZ()));
    case ShapeKind::convex:
    case ShapeKind::mesh:
    case ShapeKind::compound:  // refused before
      break;
  }
  const Mesh& mesh = mesh_of(shape, meshes);
  const Address vertices = copy<Float3>(to_module(mesh.vertices));  // the module frees its arguments
  const auto numbers = static_cast<std::uint32_t>(3 * mesh.vertices.size());
  if (shape.kind == ShapeKind::convex) return w2c_rapier_rawshape_convexHull(m, vertices, numbers);
  const Address triangles = copy(std::span(mesh.triangles));
  return w2c_rapier_rawshape_trimesh(m, vertices, numbers, triangles,
                                     static_cast<std::uint32_t>(3 * mesh.triangles.size()), kFixInternalEdges);
}

Address Module::make_shape(const Shape& shape, std::span<const Mesh> meshes) {
  const Address made = make_geometry(shape, meshes);
  if (made == 0) throw Error(ExitCode::failed, "rapier: a shape cannot be made; its mesh may be flat or empty");
  return made;
}

void Module::make_collider(Handle handle, const Body& body, Address shape, const CollisionClass& collides) {
  w2c_rapier* m = &module_;
  const bool turned = body.shape.kind == ShapeKind::capsule || body.shape.kind == ShapeKind::cylinder;
  const Float4 q = to_module(turned ? kAlongZ : Quat::Identity());
  const Address rotation = w2c_rapier_rawrotation_new(m, q.x, q.y, q.z, q.w);
  // Rapier multiplies the values of a pair: the root of the friction gives the geometric mean.
  const auto friction = static_cast<float>(std::sqrt(body.material.friction));
  const auto restitution = static_cast<float>(body.material.restitution);
  const std::uint32_t groups = collides.member << 16 | collides.meets;
  const Address result = w2c_rapier_0x5F_wbindgen_add_to_stack_pointer(m, static_cast<std::uint32_t>(-16));
  w2c_rapier_rawcolliderset_createCollider(m, result, colliders_, 1, shape, zero_, rotation, 0, 0.0F, zero_, zero_,
                                           unturned_, 0.0F, friction, restitution, kMultiply, kMultiply, 0, groups,
                                           0xFFFFFFFFU, kDefaultPairs, 0, 0, 0.0F, 0.0F, 1, handle, bodies_);
  w2c_rapier_0x5F_wbindgen_add_to_stack_pointer(m, 16);
  w2c_rapier_0x5F_wbg_rawrotation_free(m, rotation, 0);
  w2c_rapier_0x5F_wbg_rawshape_free(m, shape, 0);
}

void Module::remove(Handle body) {
  w2c_rapier_rawrigidbodyset_remove(&module_, bodies_, body, islands_, colliders_, joints_, multibody_joints_);
}

void Module::step() {
  w2c_rapier_rawphysicspipeline_step(&module_, pipeline_, zero_, parameters_, islands_, broad_phase_, narrow_phase_,
                                     bodies_, colliders_, joints_, multibody_joints_, ccd_);
}

}  // namespace subworld::rapier
