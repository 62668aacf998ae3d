#pragma once

#include "model/body.hpp"
#include "physics/adapter.hpp"
#include "physics/rapier/javascript.hpp"
#include "physics/wasm/instance.hpp"
#include "physics/wasm/vectors.hpp"

#include <rapier.h>

#include <bit>
#include <cstdint>
#include <span>

namespace subworld::rapier {

using wasm::Float3;
using wasm::Float4;
using wasm::from_module;
using wasm::to_module;

using wasm::Address;

// Layout in the memory of version 0.20.0 of the package, read in bulk: a call for each number of each body and contact
// would take as long as half a step. Strides and offsets are determined by comparison with the results of the module's
// own functions.

/// A Vec of Rust.
struct Array {
  std::uint32_t capacity;
  Address first;
  std::uint32_t count;
};

/// A rigid body; the array is at `kBodies` of the set, each after a header.
struct RigidBody {
  std::uint32_t header[4];
  Float4 rotation;
  Float3 translation;
  std::uint32_t between[63];
  Float3 linear_velocity, angular_velocity;
  std::uint32_t more[19];
  std::uint8_t gyroscopic_torque;
  std::uint32_t rest[12];
};
static_assert(offsetof(RigidBody, linear_velocity) == 296 && offsetof(RigidBody, gyroscopic_torque) == 396);
static_assert(sizeof(RigidBody) == 448);

/// A contact's reference to a body. The others are attached to the world.
struct BodyReference {
  std::uint32_t exists;
  std::uint32_t index, generation;
};

/// Two colliders that are near each other.
struct ContactPair {
  std::uint32_t before[32];
  Array manifolds;
  std::uint32_t rest[17];
};
static_assert(sizeof(ContactPair) == 208);

/// Contact points of one normal.
struct Manifold {
  BodyReference bodies[2];
  Array solved;  ///< of SolvedContact
  std::uint32_t between[4];
  Float3 normal;  ///< from the first to the second body
  std::uint32_t more[4];
  Array points;  ///< of Point
  std::uint32_t rest[9];
};
static_assert(sizeof(Manifold) == 128);

/// A contact point that was solved.
struct SolvedContact {
  Float3 anchors[2];  ///< on each body, from its centre in its frame; for the world, in the world's frame
  std::uint32_t between[4];
  std::uint32_t point;  ///< index among the manifold's points
  std::uint32_t rest;
};
static_assert(sizeof(SolvedContact) == 48);

struct Point {
  float carried;  ///< follows the point from step to step; used only with Rapier's other friction model
  float between[3];
  float impulse;  ///< N s, of the whole step plus the `last` of the step before
  float last;     ///< N s, of the last iteration
  float twist;
  Float3 last_tangential;  ///< N s, of the last iteration and of all points of the manifold, in the world's frame
  std::uint32_t rest[15];
};
static_assert(offsetof(Point, last_tangential) == 28 && sizeof(Point) == 100);

/// IntegrationParameters, after a word of wasm-bindgen's.
struct Parameters {
  std::uint32_t borrowed;
  float frequency, damping;              ///< Hz and damping ratio, for contacts of two movable bodies
  float fixed_frequency, fixed_damping;  ///< for other contacts
  float dt;
  float smallest_ccd_step;
  float warm_start;
  float length_unit;
  float allowed_error;
  float correction_speed;  ///< m/s
  float prediction;        ///< m
  float speed_limit;       ///< m/s
  std::uint32_t iterations, inner_iterations, stabilisations;
  std::uint32_t ccd_substeps;
  float recycle_distance;  ///< m
  std::uint8_t clusters_contacts, recycles_contacts, friction_while_correcting, warm_starts_joints;
};
static_assert(offsetof(Parameters, clusters_contacts) == 72);

/// A handle of a body or collider, as in the module's functions: index in the lower half, generation in the upper.
using Handle = double;
[[nodiscard]] inline std::uint64_t bits(Handle handle) { return std::bit_cast<std::uint64_t>(handle); }
[[nodiscard]] inline std::uint32_t index_of(Handle handle) { return static_cast<std::uint32_t>(bits(handle)); }

/// One instance of the module, with its own memory and world. The world has no gravity.
class Module : public wasm::Instance<w2c_rapier, wasm2c_rapier_free> {
 public:
  Module();

  [[nodiscard]] Parameters& parameters() { return *at<Parameters>(parameters_); }
  [[nodiscard]] Address bodies() const noexcept { return bodies_; }

  /// Vectors as arguments, each valid until its next use.
  [[nodiscard]] Address first(const Vec3& v) { return put(vectors_[0], v); }
  [[nodiscard]] Address second(const Vec3& v) { return put(vectors_[1], v); }
  [[nodiscard]] Address zero() const noexcept { return zero_; }
  [[nodiscard]] Address unturned() const noexcept { return unturned_; }

  /// The set's data of a body.
  [[nodiscard]] RigidBody& body(Handle handle);
  /// Nearby pairs; valid until the next call into the module.
  [[nodiscard]] std::span<const ContactPair> pairs();
  template <class T>
  [[nodiscard]] std::span<T> view(const Array& array) {
    return {at<T>(array.first, array.count), array.count};
  }

  /// Throws `Error` if that fails. make_body() takes ownership.
  [[nodiscard]] Address make_shape(const Shape& shape, std::span<const Mesh> meshes);
  [[nodiscard]] Handle make_body(const Body& body, const BodyState& state, Address shape,
                                 const CollisionClass& collides);
  void remove(Handle body);
  void step();

 private:
  template <class T>
  [[nodiscard]] T* at(Address address, std::uint64_t count = 1) {
    return reinterpret_cast<T*>(wasm::inside(memory(), address, count * sizeof(T)));
  }
  [[nodiscard]] Address put(Address vector, const Vec3& v);
  [[nodiscard]] Address make_geometry(const Shape& shape, std::span<const Mesh> meshes);
  void make_collider(Handle handle, const Body& body, Address shape, const CollisionClass& collides);
  template <class T>
  [[nodiscard]] Address copy(std::span<const T> values);

  w2c_0x2E0x2Frapier__wasm3d__bg0x2Ejs javascript_;
  Address parameters_ = 0, pipeline_ = 0, islands_ = 0, broad_phase_ = 0, narrow_phase_ = 0, bodies_ = 0,
          colliders_ = 0, joints_ = 0, multibody_joints_ = 0, ccd_ = 0;
  Address vectors_[2] = {}, zero_ = 0, unturned_ = 0;
};

}  // namespace subworld::rapier
