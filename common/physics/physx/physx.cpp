#include "model/error.hpp"
#include "physics/wasm/module_engine.hpp"
#include "physx_module.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

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

class Physx final : public wasm::ModuleEngine {
 public:
  Physx(const EngineSettings& settings, std::span<const Mesh> meshes)
      : ModuleEngine(kPlugin, settings, meshes),
        iterations_(
            static_cast<std::uint32_t>(std::min(settings.iterations.value_or(preset_.iterations), kMostIterations))),
        pushed_apart_(static_cast<float>(kPushedApart / settings.length_unit_m)) {}

  double integration_substep_s(double dt) const noexcept override {
    return ModuleEngine::integration_substep_s(dt) / iterations_;
  }

 private:
  wasm_rt_memory_t& memory() const override { return module_.memory(); }

  void make(Slot& slot, const Body& body, const BodyState& state, const CollisionClass& collides) override {
    const Address shape = module_.make_shape(body.shape, body.material, collides, meshes_);
    w2c_physx* m = module_.get();
    const Address pose = module_.scratch().put(Transform{to_module(state.orientation), to_module(state.position)});
    const Address actor = slot.fixed
                              ? w2c_physx_emscripten_bind_PxPhysics_createRigidStatic_1(m, module_.physics(), pose)
                              : w2c_physx_emscripten_bind_PxPhysics_createRigidDynamic_1(m, module_.physics(), pose);
    if (actor == 0) throw Error(ExitCode::failed, fmt::format("physx: body {} cannot be made", slot.id));
    slot.body = actor;
    w2c_physx_emscripten_bind_PxRigidActor_attachShape_1(m, actor, shape);
    w2c_physx_emscripten_bind_PxShape_release_0(m, shape);
    w2c_physx_emscripten_bind_PxActor_set_userData_1(m, actor, slot.id);
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

  void destroy(Slot& slot) override {
    w2c_physx_emscripten_bind_PxScene_removeActor_1(module_.get(), module_.scene(), actor(slot));
    if (slot.fixed) {
      w2c_physx_emscripten_bind_PxRigidStatic_release_0(module_.get(), actor(slot));
    } else {
      w2c_physx_emscripten_bind_PxRigidDynamic_release_0(module_.get(), actor(slot));
    }
  }

  void put_inertia(Slot& slot) override {
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
    const auto pose = module_.get_at<Transform>(w2c_physx_emscripten_bind_PxRigidActor_getGlobalPose_0(m, actor(slot)));
    BodyState state{from_module(pose.translation), from_module(pose.rotation), Vec3::Zero(), Vec3::Zero()};
    if (slot.fixed) return state;  // has no velocity
    state.linear_velocity =
        from_module(module_.get_at<Float3>(w2c_physx_emscripten_bind_PxRigidBody_getLinearVelocity_0(m, actor(slot))));
    state.angular_velocity =
        from_module(module_.get_at<Float3>(w2c_physx_emscripten_bind_PxRigidBody_getAngularVelocity_0(m, actor(slot))));
    return state;
  }

  Box read_bounds(const Slot& slot) const override {
    const auto box = module_.get_at<Bounds>(
        w2c_physx_emscripten_bind_PxRigidActor_getWorldBounds_1(module_.get(), actor(slot), 1.0F));
    return {from_module(box.lower), from_module(box.upper)};
  }

  void simulate(double h) override { module_.step(h); }

  void collect() override {
    for (const auto& [first, second, point] : module_.reports()) {
      const bool swap = first > second;
      found(swap ? second : first, swap ? first : second, from_module(point.position),
            (swap ? -1.0 : 1.0) * from_module(point.normal), point.separation, from_module(point.impulse).norm());
    }
  }

  static Address actor(const Slot& slot) { return static_cast<Address>(slot.body); }

  std::uint32_t iterations_;
  float pushed_apart_;            ///< units of length a second
  mutable physx::Module module_;  ///< not const: reading from the module writes to its memory
};

const EnginePlugin kPlugin{.name = "physx",
                           .version = "PhysX 5.6.1 of physx-js-webidl 2.7.3, single precision, TGS",
                           .licence = "BSD-3-Clause",
                           .presets = kPresets,
                           .limits = {.spin_rad_s = kTurnLimit, .iterations = kMostIterations},
                           .make = make_adapter<Physx>};

}  // namespace

}  // namespace subworld

SUBWORLD_ENGINE_PLUGIN(subworld::kPlugin)
