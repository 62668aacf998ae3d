#include "havok_module.hpp"
#include "physics/wasm/module_engine.hpp"

#include <cmath>
#include <unordered_map>

namespace subworld {

namespace {

using namespace havok;

// Havok's solver has a fixed number of iterations, whatever the settings: only shorter sub-steps make it more exact.
constexpr SubstepCost kCost{.step_s = 3e-6, .body_s = 0.4e-6, .contact_s = 2.6e-6};
constexpr EnginePreset kPresets[] = {
    {.name = "fast",
     .what = "no sub-steps; the number of iterations is Havok's own",
     .cost = kCost,
     .heavy_on_light = {860, 200}},
    {.name = "quality",
     .what = "sub-steps of at most 1 ms; the number of iterations is Havok's own",
     .longest_substep_s = 1.05e-3,
     .cost = kCost,
     .heavy_on_light = {860, 860}},
};

extern const EnginePlugin kPlugin;

/// Havok's own limits (200 m/s, 100 rad/s) would stop a small part that an operator flicks.
constexpr double kSpeedLimit = 1000.0;  ///< m/s and rad/s

class Havok final : public wasm::ModuleEngine {
 public:
  Havok(const EngineSettings& settings, std::span<const Mesh> meshes)
      : ModuleEngine(kPlugin, settings, meshes), unit_m_(settings.length_unit_m) {
    wasm::Scratch& scratch = module_.scratch();
    const wasm::Address out = scratch.room<Handle>();
    check(w2c_havok_HP_World_Create(module_.get(), out), "making a world");
    world_ = scratch.get<Handle>(out);
    check(w2c_havok_HP_World_SetGravity(module_.get(), world_, scratch.put(Float3{})), "setting gravity");
    remove_drag(module_);
    // Zero disables a default: contacts get softer the shorter the step is compared with 1/60 s.
    check(w2c_havok_HP_World_SetIdealStepTime(module_.get(), world_, 0.0F), "setting the step");
    check(w2c_havok_HP_World_SetSpeedLimit(module_.get(), world_,
                                           static_cast<float>(kSpeedLimit / settings.length_unit_m),
                                           static_cast<float>(kSpeedLimit)),
          "setting the limits");
  }

  Capabilities capabilities() const noexcept override {
    Capabilities can = ModuleEngine::capabilities();
    can.longest_step_s = 0.001;
    return can;
  }

 private:
  wasm_rt_memory_t& memory() const override { return module_.memory(); }

  void make(Slot& slot, const Body& body, const BodyState& state, const CollisionClass& collides) override {
    slot.shape = make_shape(module_, body.shape, meshes_, unit_m_);
    set_material(slot, body.material);
    check(w2c_havok_HP_Shape_SetFilterInfo(module_.get(), slot.shape, module_.scratch().put(collides)), "filtering");

    wasm::Scratch& scratch = module_.scratch();
    const wasm::Address out = scratch.room<Handle>();
    check(w2c_havok_HP_Body_Create(module_.get(), out), "making a body");
    slot.body = scratch.get<Handle>(out);
    check(w2c_havok_HP_Body_SetShape(module_.get(), slot.body, slot.shape), "giving a body its shape");
    check(w2c_havok_HP_Body_SetMotionType(module_.get(), slot.body, slot.fixed ? kStatic : kDynamic), "its motion");
    check(w2c_havok_HP_Body_SetEventMask(module_.get(), slot.body, kStarted | kContinued), "its events");
    if (!slot.fixed) {
      put_inertia(slot);
      check(w2c_havok_HP_Body_SetLinearDamping(module_.get(), slot.body, 0.0F), "its damping");
      check(w2c_havok_HP_Body_SetAngularDamping(module_.get(), slot.body, 0.0F), "its damping");
      check(w2c_havok_HP_Body_SetActivationControl(module_.get(), slot.body, kAlwaysActive), "its activation");
    }
    check(w2c_havok_HP_World_AddBody(module_.get(), world_, slot.body, 0), "adding a body");
    put_pose(slot, state.position, state.orientation);
    ids_[slot.body] = slot.id;
  }

  void destroy(Slot& slot) override {
    check(w2c_havok_HP_World_RemoveBody(module_.get(), world_, slot.body), "removing a body");
    check(w2c_havok_HP_Body_Release(module_.get(), slot.body), "releasing a body");
    check(w2c_havok_HP_Shape_Release(module_.get(), slot.shape), "releasing a shape");
    ids_.erase(slot.body);
  }

  void put_inertia(Slot& slot) override {
    const MassProperties properties{
        .centre = {},
        .mass = static_cast<float>(slot.mass),
        .inertia_of_unit_mass = slot.rotates ? to_module(Vec3(slot.inertia / slot.mass)) : Float3{},
        .orientation = to_module(Quat::Identity())};
    check(w2c_havok_HP_Body_SetMassProperties(module_.get(), slot.body, module_.scratch().put(properties)), "a mass");
  }

  void put_pose(const Slot& slot, const Vec3& position, const Quat& orientation) override {
    const QTransform pose{to_module(position), to_module(orientation)};
    check(w2c_havok_HP_Body_SetQTransform(module_.get(), slot.body, module_.scratch().put(pose)), "a pose");
  }

  void put_velocities(const Slot& slot, const Vec3& linear, const Vec3& angular) override {
    wasm::Scratch& scratch = module_.scratch();
    check(w2c_havok_HP_Body_SetLinearVelocity(module_.get(), slot.body, scratch.put(to_module(linear))), "a velocity");
    check(w2c_havok_HP_Body_SetAngularVelocity(module_.get(), slot.body, scratch.put(to_module(angular))),
          "an angular velocity");
  }

  /// Havok's own impulses would use its inverse masses, which have 8 bits: an error of up to 0.4 %.
  void load(const Slot& slot, const wasm::Load& load) override {
    put_velocities(slot, load.loaded.linear_velocity, load.loaded.angular_velocity);
  }

  BodyState read(const Slot& slot) const override {
    wasm::Scratch& scratch = module_.scratch();
    const wasm::Address pose_at = scratch.room<QTransform>();
    const wasm::Address linear_at = scratch.room<Float3>();
    const wasm::Address angular_at = scratch.room<Float3>();
    check(w2c_havok_HP_Body_GetQTransform(module_.get(), slot.body, pose_at), "reading a pose");
    check(w2c_havok_HP_Body_GetLinearVelocity(module_.get(), slot.body, linear_at), "reading a velocity");
    check(w2c_havok_HP_Body_GetAngularVelocity(module_.get(), slot.body, angular_at), "reading an angular velocity");
    const auto pose = scratch.get<QTransform>(pose_at);
    return {from_module(pose.translation), from_module(pose.rotation), from_module(scratch.get<Float3>(linear_at)),
            from_module(scratch.get<Float3>(angular_at))};
  }

  Box read_bounds(const Slot& slot) const override {
    wasm::Scratch& scratch = module_.scratch();
    const wasm::Address pose = scratch.room<QTransform>();
    const wasm::Address out = scratch.room<Aabb>();
    check(w2c_havok_HP_Body_GetQTransform(module_.get(), slot.body, pose), "reading a pose");
    check(w2c_havok_HP_Shape_GetBoundingBox(module_.get(), slot.shape, pose, out), "reading bounds");
    const auto box = scratch.get<Aabb>(out);
    return {from_module(box.lower), from_module(box.upper)};
  }

  void simulate(double h) override {
    check(w2c_havok_HP_World_Step(module_.get(), world_, static_cast<float>(h)), "a step");
  }

  void collect() override {
    const wasm::Address event_at = module_.scratch().put(wasm::Address{0});  // in: the event before; out: the next
    for (;;) {
      if (w2c_havok_HP_World_GetNextCollisionEvent(module_.get(), world_, event_at) != 0) return;  // no further event
      const auto at = wasm::load<wasm::Address>(module_.memory(), event_at);
      const auto event = wasm::load<CollisionEvent>(module_.memory(), at);
      if (event.type != kStarted && event.type != kContinued) continue;
      const auto a = ids_.find(event.a.body);
      const auto b = ids_.find(event.b.body);
      if (a == ids_.end() || b == ids_.end()) continue;
      const bool swap = a->second > b->second;
      const ContactPoint& on_a = swap ? event.b : event.a;
      const ContactPoint& on_b = swap ? event.a : event.b;
      const Vec3 point = from_module(on_b.position);
      const Vec3 normal = from_module(on_b.normal);
      found(swap ? b->second : a->second, swap ? a->second : b->second, point, normal,
            (from_module(on_a.position) - point).dot(normal), event.impulse);
    }
  }

  void handles_changed() override {
    ids_.clear();
    for (const Slot& slot : slots_) {
      if (slot.used) ids_[slot.body] = slot.id;
    }
  }

  void set_material(const Slot& slot, const subworld::Material& material) {
    const auto friction = static_cast<float>(material.friction);
    const havok::Material values{friction, friction, static_cast<float>(material.restitution), kGeometricMean,
                                 kMultiply};
    check(w2c_havok_HP_Shape_SetMaterial(module_.get(), slot.shape, module_.scratch().put(values)), "a material");
  }

  double unit_m_;                 ///< of length, m
  mutable havok::Module module_;  ///< not const: reading from the module writes to its memory
  Handle world_ = 0;
  std::unordered_map<Handle, std::uint32_t> ids_;
};

const EnginePlugin kPlugin{.name = "havok",
                           .version = "Havok Physics of @babylonjs/havok 1.3.14, single precision",
                           .licence = "MIT",
                           .presets = kPresets,
                           .limits = {.smallest_box = 0.035,  // a smaller box may fall through the body below
                                      .plane_half_side_m = 0.5 * kPlaneSide_m,
                                      .speed_m_s = kSpeedLimit,
                                      .spin_rad_s = kSpeedLimit,
                                      .iterations = 0,
                                      .continuous = true},
                           .make = make_adapter<Havok>};

}  // namespace

}  // namespace subworld

SUBWORLD_ENGINE_PLUGIN(subworld::kPlugin)
