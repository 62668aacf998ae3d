#include "havok_module.hpp"
#include "model/error.hpp"
#include "physics/contact_totals.hpp"
#include "physics/friction_estimate.hpp"
#include "physics/gyroscope.hpp"
#include "physics/plugin.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <unordered_map>
#include <utility>

namespace subworld {

namespace {

using namespace havok;

struct Preset {
  double longest_substep_s;  ///< step() divides its dt until no part is longer
};

// Havok's solver has a fixed number of iterations, whatever the settings ask for: shorter sub-steps are its one way to
// be more exact.
constexpr EnginePreset kPresets[] = {
    {"fast", "no sub-steps; the number of iterations is Havok's own"},
    {"quality", "sub-steps of at most 1 ms; the number of iterations is Havok's own"},
};
constexpr Preset kPresetValues[] = {
    {INFINITY},
    {1.05e-3},
};

extern const EnginePlugin kPlugin;

constexpr Filter kMovable{1, 1 | 2 | 4};
constexpr Filter kFixed{2, 1};
constexpr Filter kGhosts{4, 1};

/// Havok's own limits (200 m/s, 100 rad/s) would stop a small part that a hand flicks.
constexpr double kSpeedLimit = 1000.0;  ///< m/s and rad/s

/// A point is taken for the same one in the next sub-step if it lies within this part of the smallest body's size.
constexpr double kReachRatio = 0.1;

struct Slot {
  Handle body = 0;  ///< 0: no body of this id
  Handle shape = 0;
  bool fixed = false;
  bool plane = false;
  bool rotates = true;
  double friction = 0.0;
  double mass = 0.0;            ///< kg
  Vec3 inertia = Vec3::Zero();  ///< kg m^2
  Vec3 weight = Vec3::Zero();   ///< N
  Vec3 force = Vec3::Zero();    ///< of the next step
  Vec3 torque = Vec3::Zero();
  BodyState after;  ///< of a movable body at the end of the last sub-step; of a fixed one, the velocity it was given
};

/// Bodies leave a checkpoint as this, before the module's memory.
struct SavedBody {
  std::uint32_t id;
  std::uint32_t padding;
  Handle body, shape;
  std::array<double, 20> numbers;
};

class Havok final : public Engine {
 public:
  Havok(const EngineSettings& settings, std::span<const Mesh> meshes)
      : preset_(kPresetValues[find_preset(kPlugin, settings.preset)]),
        gravity_(settings.gravity),
        fixed_substeps_(settings.substeps.value_or(0)),
        unit_m_(settings.length_unit_m),
        meshes_(meshes.begin(), meshes.end()) {
    wasm::Scratch& scratch = module_.scratch();
    const wasm::Address out = scratch.room<Handle>();
    check(w2c_havok_HP_World_Create(module_.get(), out), "making a world");
    world_ = scratch.get<Handle>(out);
    // Gravity is applied here as a force, so that set_inertia() leaves the weight alone.
    check(w2c_havok_HP_World_SetGravity(module_.get(), world_, scratch.put(Float3{})), "setting gravity");
    remove_drag(module_);
    // Zero switches off that contacts get softer the shorter the step is against 1/60 s.
    check(w2c_havok_HP_World_SetIdealStepTime(module_.get(), world_, 0.0F), "setting the step");
    check(w2c_havok_HP_World_SetSpeedLimit(module_.get(), world_,
                                           static_cast<float>(kSpeedLimit / settings.length_unit_m),
                                           static_cast<float>(kSpeedLimit)),
          "setting the limits");
  }

  std::string_view name() const noexcept override { return "havok"; }

  Capabilities capabilities() const noexcept override {
    return {.normal_impulse = Fidelity::exact,
            .tangential_impulse = Fidelity::estimated,  // from the balance of momentum
            .gyroscopic = Fidelity::exact,              // the adapter's own
            .checkpoint = Fidelity::exact,
            .deterministic = true,
            .precision = std::numeric_limits<float>::epsilon(),
            .longest_step_s = 0.001};
  }

  void add(const Body& body, const BodyState& state, Role role) override {
    const std::uint32_t id = index(body.id);
    if (contains(body.id)) throw Error(ExitCode::failed, fmt::format("body {} is in the engine already", id));
    if (!finite(state)) throw Error(ExitCode::failed, fmt::format("body {} has a state that is not finite", id));
    if (id >= slots_.size()) slots_.resize(id + 1);
    Slot slot;
    slot.shape = make_shape(module_, body.shape, meshes_, unit_m_);
    slot.fixed = body.fixed();
    slot.plane = body.shape.kind == ShapeKind::plane;
    slot.rotates = body.rotates;
    slot.friction = body.material.friction;
    if (body.gravity && !body.fixed()) slot.weight = body.mass * gravity_;
    set_material(slot, body.material);
    const Filter filter = role == Role::ghost ? kGhosts : body.fixed() ? kFixed : kMovable;
    check(w2c_havok_HP_Shape_SetFilterInfo(module_.get(), slot.shape, module_.scratch().put(filter)), "filtering");

    wasm::Scratch& scratch = module_.scratch();
    const wasm::Address out = scratch.room<Handle>();
    check(w2c_havok_HP_Body_Create(module_.get(), out), "making a body");
    slot.body = scratch.get<Handle>(out);
    check(w2c_havok_HP_Body_SetShape(module_.get(), slot.body, slot.shape), "giving a body its shape");
    check(w2c_havok_HP_Body_SetMotionType(module_.get(), slot.body, body.fixed() ? kStatic : kDynamic), "its motion");
    check(w2c_havok_HP_Body_SetEventMask(module_.get(), slot.body, kStarted | kContinued), "its events");
    slots_[id] = slot;
    if (!body.fixed()) {
      set_inertia(body.id, body.mass, body.inertia);
      check(w2c_havok_HP_Body_SetLinearDamping(module_.get(), slot.body, 0.0F), "its damping");
      check(w2c_havok_HP_Body_SetAngularDamping(module_.get(), slot.body, 0.0F), "its damping");
      check(w2c_havok_HP_Body_SetActivationControl(module_.get(), slot.body, kAlwaysActive), "its activation");
    }
    check(w2c_havok_HP_World_AddBody(module_.get(), world_, slot.body, 0), "adding a body");
    place(slots_[id], state);
    ids_[slot.body] = id;
    contacts_.clear();
    if (body.fixed()) return;
    movable_.push_back(id);
    const Box size = bounds(body.id);
    reach_ = std::min(reach_, kReachRatio * (size.upper - size.lower).minCoeff());
  }

  void remove(BodyId id) override {
    Slot& slot = at(id);
    check(w2c_havok_HP_World_RemoveBody(module_.get(), world_, slot.body), "removing a body");
    check(w2c_havok_HP_Body_Release(module_.get(), slot.body), "releasing a body");
    check(w2c_havok_HP_Shape_Release(module_.get(), slot.shape), "releasing a shape");
    ids_.erase(slot.body);
    slot = {};
    std::erase(movable_, index(id));
    contacts_.clear();
  }

  bool contains(BodyId id) const noexcept override { return index(id) < slots_.size() && slots_[index(id)].body != 0; }

  BodyState state(BodyId id) const override { return read_state(at(id)); }

  bool set_state(BodyId id, const BodyState& state) override {
    if (!finite(state)) return false;
    place(at(id), state);
    return true;
  }

  bool set_velocity(BodyId id, const Vec3& linear, const Vec3& angular) override {
    if (!linear.allFinite() || !angular.allFinite()) return false;
    set_velocities(at(id), linear, angular);
    return true;
  }

  void set_inertia(BodyId id, double mass, const Vec3& inertia) override {
    Slot& slot = at(id);
    slot.mass = mass;
    slot.inertia = inertia;
    const MassProperties properties{.centre = {},
                                    .mass = static_cast<float>(mass),
                                    .inertia_of_unit_mass = slot.rotates ? to_havok(Vec3(inertia / mass)) : Float3{},
                                    .orientation = to_havok(Quat::Identity())};
    check(w2c_havok_HP_Body_SetMassProperties(module_.get(), slot.body, module_.scratch().put(properties)), "a mass");
  }

  bool apply_impulse(BodyId id, const Vec3& impulse, const Vec3& point) override {
    if (!impulse.allFinite() || !point.allFinite()) return false;
    Slot& slot = at(id);
    const BodyState now = read_state(slot);
    accelerate(slot, now, impulse, (point - now.position).cross(impulse));
    return true;
  }

  bool apply_force(BodyId id, const Vec3& force, const Vec3& torque) override {
    if (!force.allFinite() || !torque.allFinite()) return false;
    Slot& slot = at(id);
    slot.force += force;
    slot.torque += torque;
    return true;
  }

  void step(double dt) override {
    const int substeps = fixed_substeps_ > 0 ? fixed_substeps_
                                             : std::max(1, static_cast<int>(std::ceil(dt / preset_.longest_substep_s)));
    const double h = dt / substeps;
    contacts_.clear();
    for (int i = 0; i < substeps; ++i) {
      apply_loads(h);
      check(w2c_havok_HP_World_Step(module_.get(), world_, static_cast<float>(h)), "a step");
      for (const std::uint32_t id : movable_) slots_[id].after = read_state(slots_[id]);
      collect_contacts();
      complete_contacts(i);
    }
    for (const std::uint32_t id : movable_) slots_[id].force = slots_[id].torque = Vec3::Zero();
    contacts_.merge();
  }

  std::span<const Contact> contacts() const noexcept override { return contacts_.contacts(); }

  Box bounds(BodyId id) const override { return read_bounds(at(id)); }

  void overlap(const Box& box, std::vector<BodyId>& out) const override {
    out.clear();
    for (std::uint32_t id = 0; id < slots_.size(); ++id) {
      if (slots_[id].body != 0 && read_bounds(slots_[id]).meets(box)) out.push_back(BodyId{id});
    }
  }

  Checkpoint checkpoint() const override {
    Checkpoint saved;
    const auto append = [&saved](const auto& value) { wasm::append(&value, sizeof value, saved.bytes); };
    append(static_cast<std::uint64_t>(ids_.size()));
    for (std::uint32_t id = 0; id < slots_.size(); ++id) {
      const Slot& slot = slots_[id];
      if (slot.body == 0) continue;
      SavedBody entry{id, 0, slot.body, slot.shape, {}};
      Eigen::Map<Eigen::Matrix<double, 20, 1>>(entry.numbers.data()) << slot.mass, slot.inertia, slot.weight,
          slot.force, slot.torque, slot.friction, slot.after.linear_velocity, slot.after.angular_velocity;
      append(entry);
    }
    wasm::save(module_.memory(), saved.bytes);
    return saved;
  }

  void restore(const Checkpoint& saved) override {
    std::uint64_t count = 0;
    if (saved.bytes.size() > sizeof count) std::memcpy(&count, saved.bytes.data(), sizeof count);
    if (count != ids_.size() || saved.bytes.size() < sizeof count + count * sizeof(SavedBody)) refuse_checkpoint();
    const auto entry_at = [&](std::size_t i) {
      SavedBody entry;
      std::memcpy(&entry, saved.bytes.data() + sizeof count + i * sizeof entry, sizeof entry);
      return entry;
    };
    for (std::size_t i = 0; i < count; ++i) {
      const SavedBody entry = entry_at(i);
      const bool movable = entry.numbers[0] > 0.0;
      if (!contains(BodyId{entry.id}) || slots_[entry.id].fixed == movable) refuse_checkpoint();
    }
    wasm::restore(module_.memory(), std::span(saved.bytes).subspan(sizeof count + count * sizeof(SavedBody)));
    ids_.clear();
    for (std::size_t i = 0; i < count; ++i) {
      const SavedBody entry = entry_at(i);
      const Eigen::Map<const Eigen::Matrix<double, 20, 1>> x(entry.numbers.data());
      Slot& slot = slots_[entry.id];
      slot.body = entry.body;
      slot.shape = entry.shape;
      slot.mass = x[0];
      slot.inertia = x.segment<3>(1);
      slot.weight = x.segment<3>(4);
      slot.force = x.segment<3>(7);
      slot.torque = x.segment<3>(10);
      slot.friction = x[13];
      slot.after.linear_velocity = x.segment<3>(14);
      slot.after.angular_velocity = x.segment<3>(17);
      ids_[entry.body] = entry.id;
    }
    contacts_.clear();
  }

 private:
  [[noreturn]] static void refuse_checkpoint() {
    throw Error(ExitCode::failed, "the checkpoint is of another engine or of other bodies; take one from this engine");
  }

  Slot& at(BodyId id) { return const_cast<Slot&>(std::as_const(*this).at(id)); }
  const Slot& at(BodyId id) const {
    if (!contains(id)) throw Error(ExitCode::failed, fmt::format("body {} is not in the engine", index(id)));
    return slots_[index(id)];
  }

  void set_material(const Slot& slot, const subworld::Material& material) {
    const auto friction = static_cast<float>(material.friction);
    const havok::Material values{friction, friction, static_cast<float>(material.restitution), kGeometricMean,
                                 kMultiply};
    check(w2c_havok_HP_Shape_SetMaterial(module_.get(), slot.shape, module_.scratch().put(values)), "a material");
  }

  void place(Slot& slot, const BodyState& state) {
    wasm::Scratch& scratch = module_.scratch();
    const QTransform pose{to_havok(state.position), to_havok(state.orientation)};
    check(w2c_havok_HP_Body_SetQTransform(module_.get(), slot.body, scratch.put(pose)), "a pose");
    set_velocities(slot, state.linear_velocity, state.angular_velocity);
  }

  static BodyState accelerated(const Slot& slot, BodyState state, const Vec3& impulse, const Vec3& angular) {
    state.linear_velocity += impulse / slot.mass;
    if (slot.rotates) state.angular_velocity += spun_up(state.orientation, slot.inertia, angular);
    return state;
  }

  void set_velocities(Slot& slot, const Vec3& linear, const Vec3& angular) {
    if (slot.fixed) {
      slot.after.linear_velocity = linear;
      slot.after.angular_velocity = angular;
      return;
    }
    wasm::Scratch& scratch = module_.scratch();
    check(w2c_havok_HP_Body_SetLinearVelocity(module_.get(), slot.body, scratch.put(to_havok(linear))), "a velocity");
    check(w2c_havok_HP_Body_SetAngularVelocity(module_.get(), slot.body, scratch.put(to_havok(angular))),
          "an angular velocity");
  }

  /// Changes the velocities by an impulse (N s) and an angular impulse (N m s) about the centre of mass. Havok's own
  /// functions would do it with its inverse masses, which it keeps to 8 bits: up to 0.4 % off.
  void accelerate(Slot& slot, const BodyState& now, const Vec3& impulse, const Vec3& angular) {
    const BodyState then = accelerated(slot, now, impulse, angular);
    set_velocities(slot, then.linear_velocity, then.angular_velocity);
  }

  /// Weight, applied forces and the gyroscopic torque of a sub-step of length `h` (s).
  void apply_loads(double h) {
    changes_.assign(slots_.size(), {});
    for (const std::uint32_t id : movable_) {
      Slot& slot = slots_[id];
      BodyState state = read_state(slot);
      if (slot.rotates && feels_gyroscopic_torque(slot.inertia)) {
        state.angular_velocity = turned_freely(state.orientation, slot.inertia, state.angular_velocity, h);
      }
      state = accelerated(slot, state, h * (slot.weight + slot.force), h * slot.torque);
      set_velocities(slot, state.linear_velocity, state.angular_velocity);
      changes_[id] = open_change(slot.mass, slot.inertia, slot.rotates, state);
    }
  }

  BodyState read_state(const Slot& slot) const {
    wasm::Scratch& scratch = module_.scratch();
    const wasm::Address pose_at = scratch.room<QTransform>();
    const wasm::Address linear_at = scratch.room<Float3>();
    const wasm::Address angular_at = scratch.room<Float3>();
    check(w2c_havok_HP_Body_GetQTransform(module_.get(), slot.body, pose_at), "reading a pose");
    check(w2c_havok_HP_Body_GetLinearVelocity(module_.get(), slot.body, linear_at), "reading a velocity");
    check(w2c_havok_HP_Body_GetAngularVelocity(module_.get(), slot.body, angular_at), "reading an angular velocity");
    const auto pose = scratch.get<QTransform>(pose_at);
    if (slot.fixed) {
      return {from_havok(pose.translation), from_havok(pose.rotation), slot.after.linear_velocity,
              slot.after.angular_velocity};
    }
    return {from_havok(pose.translation), from_havok(pose.rotation), from_havok(scratch.get<Float3>(linear_at)),
            from_havok(scratch.get<Float3>(angular_at))};
  }

  Box read_bounds(const Slot& slot) const {
    constexpr double kEverywhere = 1e18;
    if (slot.plane) return {Vec3::Constant(-kEverywhere), Vec3::Constant(kEverywhere)};
    wasm::Scratch& scratch = module_.scratch();
    const wasm::Address pose = scratch.room<QTransform>();
    const wasm::Address out = scratch.room<Aabb>();
    check(w2c_havok_HP_Body_GetQTransform(module_.get(), slot.body, pose), "reading a pose");
    check(w2c_havok_HP_Shape_GetBoundingBox(module_.get(), slot.shape, pose, out), "reading bounds");
    const auto box = scratch.get<Aabb>(out);
    return {from_havok(box.lower), from_havok(box.upper)};
  }

  void collect_contacts() {
    found_.clear();
    const wasm::Address event_at = module_.scratch().put(wasm::Address{0});  // in: the event before; out: the next
    for (;;) {
      if (w2c_havok_HP_World_GetNextCollisionEvent(module_.get(), world_, event_at) != 0) return;  // no more
      const auto at = wasm::load<wasm::Address>(module_.memory(), event_at);
      const auto event = wasm::load<CollisionEvent>(module_.memory(), at);
      if (event.type != kStarted && event.type != kContinued) continue;
      const auto a = ids_.find(event.a.body);
      const auto b = ids_.find(event.b.body);
      if (a == ids_.end() || b == ids_.end()) continue;
      const Contact contact = a->second < b->second ? read(a->second, b->second, event, event.a, event.b)
                                                    : read(b->second, a->second, event, event.b, event.a);
      if (contact.normal_impulse <= 0.0 && contact.distance > 0.0) continue;
      found_.push_back(contact);
    }
  }

  Contact read(std::uint32_t a, std::uint32_t b, const CollisionEvent& event, const ContactPoint& on_a,
               const ContactPoint& on_b) const {
    Contact contact;
    contact.a = BodyId{a};
    contact.b = BodyId{b};
    contact.point = from_havok(on_b.position);
    contact.normal = from_havok(on_b.normal);
    contact.distance = (from_havok(on_a.position) - contact.point).dot(contact.normal);
    contact.normal_impulse = event.impulse;
    const Vec3 relative = velocity_at(slots_[a], contact.point) - velocity_at(slots_[b], contact.point);
    contact.tangential_velocity = relative - relative.dot(contact.normal) * contact.normal;
    return contact;
  }

  /// Adds the friction that the engine does not tell, and the sub-step's contacts to the step's.
  void complete_contacts(int substep) {
    for (const std::uint32_t id : movable_) close(changes_[id], slots_[id].after);
    friction_.clear();
    for (const Contact& c : found_) {
      friction_.push_back(std::sqrt(slots_[index(c.a)].friction * slots_[index(c.b)].friction));
    }
    estimate_.estimate(changes_, friction_, found_);
    for (const Contact& c : found_) contacts_.add(c, substep, reach_);
  }

  static Vec3 velocity_at(const Slot& slot, const Vec3& point) {
    if (slot.fixed) return Vec3::Zero();
    return slot.after.linear_velocity + slot.after.angular_velocity.cross(point - slot.after.position);
  }

  Preset preset_;
  Vec3 gravity_;
  int fixed_substeps_;  ///< 0: as the preset says
  double unit_m_;       ///< of length, m
  std::vector<Mesh> meshes_;
  mutable havok::Module module_;  ///< also to read from it, the module writes to its memory
  Handle world_ = 0;
  std::vector<Slot> slots_;
  std::unordered_map<Handle, std::uint32_t> ids_;
  std::vector<std::uint32_t> movable_;   ///< ids, in the order of adding
  double reach_ = 0.05;                  ///< m
  std::vector<VelocityChange> changes_;  ///< of a sub-step, by id
  std::vector<Contact> found_;           ///< of a sub-step
  std::vector<double> friction_;         ///< of found_
  FrictionEstimate estimate_;
  ContactTotals contacts_;
};

const EnginePlugin kPlugin{
    .name = "havok",
    .version = "Havok Physics of @babylonjs/havok 1.3.14, single precision",
    .licence = "MIT",
    .presets = kPresets,
    .make = [](const EngineSettings& settings, std::span<const Mesh> meshes) -> std::unique_ptr<Engine> {
      return std::make_unique<Havok>(settings, meshes);
    }};

}  // namespace

}  // namespace subworld

SUBWORLD_ENGINE_PLUGIN(subworld::kPlugin)
