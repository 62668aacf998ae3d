#include "model/error.hpp"
#include "physics/wasm/module_engine.hpp"
#include "physx_module.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace subworld {

namespace {

using namespace physx;

constexpr SubstepCost kCost{.step_s = 8e-6, .body_s = 0.4e-6, .contact_s = 1.2e-6, .contact_iteration_s = 0.08e-6};
constexpr EnginePreset kPresets[] = {
    {.name = "fast",
     .what = "4 iterations, no sub-steps: each iteration of TGS is a small time step of its own",
     .iterations = 4,
     .cost = kCost,
     .heavy_on_light = {1700, 270}},
    {.name = "quality",
     .what = "16 iterations, sub-steps of at most 2 ms: holds stacks and houses of cards",
     .iterations = 16,
     .longest_substep_s = 2.1e-3,
     .cost = kCost,
     .heavy_on_light = {1700, 1700}},
};

extern const EnginePlugin kPlugin;

/// PhysX's own limit (100 rad/s) would stop a small part that an operator flicks.
constexpr float kTurnLimit = 1000.0F;  ///< rad/s

/// Speed at which overlapping bodies are separated, m/s. Without a limit an overlap of 4 mm throws a brick.
constexpr double kPushedApart = 0.5;

/// Number of velocity iterations of a body. An iteration removes the speed of separation from a penetration; without it
/// a high stack creeps. It also brakes bodies that are about to touch, so a bouncing body has none. Of two touching
/// bodies, the larger number counts.
constexpr std::uint32_t velocity_iterations(const Material& material) { return material.restitution > 0.0 ? 0 : 1; }

constexpr int kMostIterations = 255;  ///< PhysX has a byte for them

/// Of one pair; further points are not read.
constexpr std::uint32_t kMostPoints = 64;

/// A contact point in PhysX's report, before the velocities of the sub-step are known.
struct Report {
  std::uint32_t first, second;
  ContactPoint point;
};

class Physx final : public wasm::ModuleEngine, private ContactListener {
 public:
  Physx(const EngineSettings& settings, std::span<const Mesh> meshes)
      : Physx(settings, meshes, kPresets[find_preset(kPlugin, settings.preset)]) {}

  std::string_view name() const noexcept override { return "physx"; }
  double integration_substep_s(double dt) const noexcept override {
    return ModuleEngine::integration_substep_s(dt) / iterations_;
  }

  Capabilities capabilities() const noexcept override {
    return {.normal_impulse = Fidelity::exact,
            .tangential_impulse = Fidelity::estimated,  // from the balance of momentum
            .gyroscopic = Fidelity::exact,              // computed by the adapter
            .checkpoint = Fidelity::exact,
            .deterministic = true,
            .precision = std::numeric_limits<float>::epsilon()};
  }

 private:
  Physx(const EngineSettings& settings, std::span<const Mesh> meshes, const EnginePreset& preset)
      : ModuleEngine(settings, preset.longest_substep_s),
        iterations_(
            static_cast<std::uint32_t>(std::min(settings.iterations.value_or(preset.iterations), kMostIterations))),
        pushed_apart_(static_cast<float>(kPushedApart / settings.length_unit_m)),
        meshes_(meshes.begin(), meshes.end()),
        module_(*this),
        points_(module_.allocate(kMostPoints * sizeof(ContactPoint))) {}

  wasm_rt_memory_t& memory() const override { return module_.memory(); }

  void create(BodyId id, Slot& slot, const Body& body, const BodyState& state, const wasm::Filter& filter) override {
    const Address shape = module_.make_shape(body.shape, body.material, filter, meshes_);
    w2c_physx* m = module_.get();
    const Address pose = module_.scratch().put(Transform{to_module(state.orientation), to_module(state.position)});
    const Address actor = slot.fixed
                              ? w2c_physx_emscripten_bind_PxPhysics_createRigidStatic_1(m, module_.physics(), pose)
                              : w2c_physx_emscripten_bind_PxPhysics_createRigidDynamic_1(m, module_.physics(), pose);
    if (actor == 0) throw Error(ExitCode::failed, fmt::format("physx: body {} cannot be made", index(id)));
    slot.body = actor;
    w2c_physx_emscripten_bind_PxRigidActor_attachShape_1(m, actor, shape);
    w2c_physx_emscripten_bind_PxShape_release_0(m, shape);
    w2c_physx_emscripten_bind_PxActor_set_userData_1(m, actor, index(id));
    if (!slot.fixed) {
      put_inertia(slot);
      w2c_physx_emscripten_bind_PxRigidBody_setAngularDamping_1(m, actor, 0.0F);
      w2c_physx_emscripten_bind_PxRigidBody_setMaxAngularVelocity_1(m, actor, kTurnLimit);
      w2c_physx_emscripten_bind_PxRigidBody_setMaxDepenetrationVelocity_1(m, actor, pushed_apart_);
      w2c_physx_emscripten_bind_PxRigidDynamic_setSleepThreshold_1(m, actor, 0.0F);
      w2c_physx_emscripten_bind_PxRigidDynamic_setSolverIterationCounts_2(m, actor, iterations_,
                                                                          velocity_iterations(body.material));
    }
    w2c_physx_emscripten_bind_PxScene_addActor_1(m, module_.scene(), actor);
    put_pose(slot, state.position, state.orientation);
  }

  void destroy(const Slot& slot) override {
    w2c_physx_emscripten_bind_PxScene_removeActor_1(module_.get(), module_.scene(), actor(slot));
    if (slot.fixed) {
      w2c_physx_emscripten_bind_PxRigidStatic_release_0(module_.get(), actor(slot));
    } else {
      w2c_physx_emscripten_bind_PxRigidDynamic_release_0(module_.get(), actor(slot));
    }
  }

  void put_inertia(const Slot& slot) override {
    w2c_physx_emscripten_bind_PxRigidBody_setMass_1(module_.get(), actor(slot), static_cast<float>(slot.mass));
    // Zero: does not rotate.
    w2c_physx_emscripten_bind_PxRigidBody_setMassSpaceInertiaTensor_1(
        module_.get(), actor(slot), module_.scratch().put(slot.rotates ? to_module(slot.inertia) : Float3{}));
  }

  void put_pose(const Slot& slot, const Vec3& position, const Quat& orientation) override {
    const Address pose = module_.scratch().put(Transform{to_module(orientation), to_module(position)});
    w2c_physx_emscripten_bind_PxRigidActor_setGlobalPose_1(module_.get(), actor(slot), pose);
  }

  void put_velocities(const Slot& slot, const Vec3& linear, const Vec3& angular) override {
    wasm::Scratch& scratch = module_.scratch();
    w2c_physx_emscripten_bind_PxRigidDynamic_setLinearVelocity_1(module_.get(), actor(slot),
                                                                 scratch.put(to_module(linear)));
    w2c_physx_emscripten_bind_PxRigidDynamic_setAngularVelocity_1(module_.get(), actor(slot),
                                                                  scratch.put(to_module(angular)));
  }

  void load(const Slot& slot, const wasm::Load& load) override {
    if (load.turned) put_velocities(slot, load.now.linear_velocity, load.now.angular_velocity);
    if (load.force.isZero(0.0) && slot.torque.isZero(0.0)) return;
    // PhysX discards the contacts when its step ends.
    wasm::Scratch& scratch = module_.scratch();
    w2c_physx_emscripten_bind_PxRigidDynamic_addForce_1(module_.get(), actor(slot), scratch.put(to_module(load.force)));
    w2c_physx_emscripten_bind_PxRigidDynamic_addTorque_1(module_.get(), actor(slot),
                                                         scratch.put(to_module(slot.torque)));
  }

  BodyState read(const Slot& slot) const override {
    w2c_physx* m = module_.get();
    const auto pose = get<Transform>(w2c_physx_emscripten_bind_PxRigidActor_getGlobalPose_0(m, actor(slot)));
    BodyState state{from_module(pose.translation), from_module(pose.rotation), Vec3::Zero(), Vec3::Zero()};
    if (slot.fixed) return state;  // has no velocity
    state.linear_velocity =
        from_module(get<Float3>(w2c_physx_emscripten_bind_PxRigidBody_getLinearVelocity_0(m, actor(slot))));
    state.angular_velocity =
        from_module(get<Float3>(w2c_physx_emscripten_bind_PxRigidBody_getAngularVelocity_0(m, actor(slot))));
    return state;
  }

  Box read_bounds(const Slot& slot) const override {
    const auto box =
        get<Bounds>(w2c_physx_emscripten_bind_PxRigidActor_getWorldBounds_1(module_.get(), actor(slot), 1.0F));
    return {from_module(box.lower), from_module(box.upper)};
  }

  void simulate(double h) override {
    reports_.clear();
    w2c_physx_emscripten_bind_PxScene_simulate_1(module_.get(), module_.scene(), static_cast<float>(h));
    if (w2c_physx_emscripten_bind_PxScene_fetchResults_1(module_.get(), module_.scene(), 1) == 0) {
      throw Error(ExitCode::failed, "physx: a step did not end");
    }
  }

  void on_contact(Address header, Address pairs, std::uint32_t count) override {
    w2c_physx* m = module_.get();
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
            {first, second, get<ContactPoint>(static_cast<Address>(points_ + p * sizeof(ContactPoint)))});
      }
    }
  }

  void collect() override {
    for (const auto& [first, second, point] : reports_) {
      const bool swap = first > second;
      found(swap ? second : first, swap ? first : second, from_module(point.position),
            (swap ? -1.0 : 1.0) * from_module(point.normal), point.separation, from_module(point.impulse).norm());
    }
  }

  static Address actor(const Slot& slot) { return static_cast<Address>(slot.body); }

  template <class T>
  T get(Address at) const {
    return wasm::load<T>(module_.memory(), at);
  }

  std::uint32_t iterations_;
  float pushed_apart_;  ///< units of length a second
  std::vector<Mesh> meshes_;
  mutable physx::Module module_;  ///< not const: reading from the module writes to its memory
  Address points_;                ///< memory for the contact points of a pair
  std::vector<Report> reports_;   ///< of a sub-step
};

const EnginePlugin kPlugin{
    .name = "physx",
    .version = "PhysX 5.6.1 of physx-js-webidl 2.7.3, single precision, TGS",
    .licence = "BSD-3-Clause",
    .presets = kPresets,
    .limits = {.spin_rad_s = kTurnLimit, .iterations = kMostIterations},
    .make = [](const EngineSettings& settings, std::span<const Mesh> meshes) -> std::unique_ptr<Engine> {
      return std::make_unique<Physx>(settings, meshes);
    }};

}  // namespace

}  // namespace subworld

SUBWORLD_ENGINE_PLUGIN(subworld::kPlugin)
