#include "model/error.hpp"
#include "physics/contact_totals.hpp"
#include "physics/friction_estimate.hpp"
#include "physics/gyroscope.hpp"
#include "physics/plugin.hpp"
#include "physx_module.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

namespace subworld {

namespace {

using namespace physx;

struct Preset {
  int iterations;            ///< each one of TGS is a small time step of its own
  double longest_substep_s;  ///< step() divides its dt until no part is longer
};

constexpr EnginePreset kPresets[] = {
    {"fast", "4 iterations, no sub-steps: each iteration of TGS is a small time step of its own"},
    {"quality", "8 iterations, sub-steps of at most 1 ms: holds stacks"},
};
constexpr Preset kPresetValues[] = {
    {4, INFINITY},
    {8, 1.05e-3},
};

extern const EnginePlugin kPlugin;

constexpr Filter kMovable{1, 1 | 2 | 4};
constexpr Filter kFixed{2, 1};
constexpr Filter kGhosts{4, 1};

/// PhysX's own limit (100 rad/s) would stop a small part that a hand flicks.
constexpr float kTurnLimit = 1000.0F;  ///< rad/s

constexpr int kMostIterations = 255;  ///< PhysX counts them in a byte

/// More points of one pair are not read.
constexpr std::uint32_t kMostPoints = 64;

/// A point is taken for the same one in the next sub-step if it lies within this part of the smallest body's size.
constexpr double kReachRatio = 0.1;

struct Slot {
  Address actor = 0;  ///< 0: no body of this id
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
  Address actor;
  std::array<double, 20> numbers;
};

/// A contact point as PhysX reports it, before the velocities of the sub-step are known.
struct Report {
  std::uint32_t first, second;
  ContactPoint point;
};

class Physx final : public Engine, private ContactListener {
 public:
  Physx(const EngineSettings& settings, std::span<const Mesh> meshes)
      : preset_(kPresetValues[find_preset(kPlugin, settings.preset)]),
        gravity_(settings.gravity),
        fixed_substeps_(settings.substeps.value_or(0)),
        iterations_(
            static_cast<std::uint32_t>(std::min(settings.iterations.value_or(preset_.iterations), kMostIterations))),
        meshes_(meshes.begin(), meshes.end()),
        module_(*this),
        points_(module_.allocate(kMostPoints * sizeof(ContactPoint))) {}

  std::string_view name() const noexcept override { return "physx"; }

  Capabilities capabilities() const noexcept override {
    return {.normal_impulse = Fidelity::exact,
            .tangential_impulse = Fidelity::estimated,  // from the balance of momentum
            .gyroscopic = Fidelity::exact,              // the adapter's own
            .checkpoint = Fidelity::exact,
            .deterministic = true,
            .precision = std::numeric_limits<float>::epsilon()};
  }

  void add(const Body& body, const BodyState& state, Role role) override {
    const std::uint32_t id = index(body.id);
    if (contains(body.id)) throw Error(ExitCode::failed, fmt::format("body {} is in the engine already", id));
    if (!finite(state)) throw Error(ExitCode::failed, fmt::format("body {} has a state that is not finite", id));
    if (id >= slots_.size()) slots_.resize(id + 1);
    Slot slot;
    slot.fixed = body.fixed();
    slot.plane = body.shape.kind == ShapeKind::plane;
    slot.rotates = body.rotates;
    slot.friction = body.material.friction;
    if (body.gravity && !body.fixed()) slot.weight = body.mass * gravity_;
    const Filter filter = role == Role::ghost ? kGhosts : body.fixed() ? kFixed : kMovable;
    const Address shape = module_.make_shape(body.shape, body.material, filter, meshes_);
    w2c_physx* m = module_.get();
    const Address pose = module_.scratch().put(Transform{to_physx(state.orientation), to_physx(state.position)});
    slot.actor = body.fixed() ? w2c_physx_emscripten_bind_PxPhysics_createRigidStatic_1(m, module_.physics(), pose)
                              : w2c_physx_emscripten_bind_PxPhysics_createRigidDynamic_1(m, module_.physics(), pose);
    if (slot.actor == 0) throw Error(ExitCode::failed, fmt::format("physx: body {} cannot be made", id));
    w2c_physx_emscripten_bind_PxRigidActor_attachShape_1(m, slot.actor, shape);
    w2c_physx_emscripten_bind_PxShape_release_0(m, shape);
    w2c_physx_emscripten_bind_PxActor_set_userData_1(m, slot.actor, id);
    slots_[id] = slot;
    if (!body.fixed()) {
      set_inertia(body.id, body.mass, body.inertia);
      w2c_physx_emscripten_bind_PxRigidBody_setAngularDamping_1(m, slot.actor, 0.0F);
      w2c_physx_emscripten_bind_PxRigidBody_setMaxAngularVelocity_1(m, slot.actor, kTurnLimit);
      w2c_physx_emscripten_bind_PxRigidDynamic_setSleepThreshold_1(m, slot.actor, 0.0F);
      w2c_physx_emscripten_bind_PxRigidDynamic_setSolverIterationCounts_2(m, slot.actor, iterations_, 1);
    }
    w2c_physx_emscripten_bind_PxScene_addActor_1(m, module_.scene(), slot.actor);
    place(slots_[id], state);
    ++count_;
    contacts_.clear();
    if (body.fixed()) return;
    movable_.push_back(id);
    const Box size = bounds(body.id);
    reach_ = std::min(reach_, kReachRatio * (size.upper - size.lower).minCoeff());
  }

  void remove(BodyId id) override {
    Slot& slot = at(id);
    w2c_physx_emscripten_bind_PxScene_removeActor_1(module_.get(), module_.scene(), slot.actor);
    if (slot.fixed) {
      w2c_physx_emscripten_bind_PxRigidStatic_release_0(module_.get(), slot.actor);
    } else {
      w2c_physx_emscripten_bind_PxRigidDynamic_release_0(module_.get(), slot.actor);
    }
    slot = {};
    --count_;
    std::erase(movable_, index(id));
    contacts_.clear();
  }

  bool contains(BodyId id) const noexcept override { return index(id) < slots_.size() && slots_[index(id)].actor != 0; }

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
    w2c_physx_emscripten_bind_PxRigidBody_setMass_1(module_.get(), slot.actor, static_cast<float>(mass));
    // Zero: does not rotate.
    w2c_physx_emscripten_bind_PxRigidBody_setMassSpaceInertiaTensor_1(
        module_.get(), slot.actor, module_.scratch().put(slot.rotates ? to_physx(inertia) : Float3{}));
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
      w2c_physx_emscripten_bind_PxScene_simulate_1(module_.get(), module_.scene(), static_cast<float>(h));
      reports_.clear();
      if (w2c_physx_emscripten_bind_PxScene_fetchResults_1(module_.get(), module_.scene(), 1) == 0) {
        throw Error(ExitCode::failed, "physx: a step did not end");
      }
      for (const std::uint32_t id : movable_) slots_[id].after = read_state(slots_[id]);
      found_.clear();
      for (const Report& report : reports_) found_.push_back(read(report));
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
      if (slots_[id].actor != 0 && read_bounds(slots_[id]).meets(box)) out.push_back(BodyId{id});
    }
  }

  Checkpoint checkpoint() const override {
    Checkpoint saved;
    const auto append = [&saved](const auto& value) { wasm::append(&value, sizeof value, saved.bytes); };
    append(count_);
    for (std::uint32_t id = 0; id < slots_.size(); ++id) {
      const Slot& slot = slots_[id];
      if (slot.actor == 0) continue;
      SavedBody entry{id, slot.actor, {}};
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
    if (count != count_ || saved.bytes.size() < sizeof count + count * sizeof(SavedBody)) refuse_checkpoint();
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
    for (std::size_t i = 0; i < count; ++i) {
      const SavedBody entry = entry_at(i);
      const Eigen::Map<const Eigen::Matrix<double, 20, 1>> x(entry.numbers.data());
      Slot& slot = slots_[entry.id];
      slot.actor = entry.actor;
      slot.mass = x[0];
      slot.inertia = x.segment<3>(1);
      slot.weight = x.segment<3>(4);
      slot.force = x.segment<3>(7);
      slot.torque = x.segment<3>(10);
      slot.friction = x[13];
      slot.after.linear_velocity = x.segment<3>(14);
      slot.after.angular_velocity = x.segment<3>(17);
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

  void place(Slot& slot, const BodyState& state) {
    const Address pose = module_.scratch().put(Transform{to_physx(state.orientation), to_physx(state.position)});
    w2c_physx_emscripten_bind_PxRigidActor_setGlobalPose_1(module_.get(), slot.actor, pose);
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
    w2c_physx_emscripten_bind_PxRigidDynamic_setLinearVelocity_1(module_.get(), slot.actor,
                                                                 scratch.put(to_physx(linear)));
    w2c_physx_emscripten_bind_PxRigidDynamic_setAngularVelocity_1(module_.get(), slot.actor,
                                                                  scratch.put(to_physx(angular)));
  }

  /// Changes the velocities by an impulse (N s) and an angular impulse (N m s) about the centre of mass.
  void accelerate(Slot& slot, const BodyState& now, const Vec3& impulse, const Vec3& angular) {
    const BodyState then = accelerated(slot, now, impulse, angular);
    set_velocities(slot, then.linear_velocity, then.angular_velocity);
  }

  /// Weight, applied forces and the gyroscopic torque of a sub-step of length `h` (s); PhysX forgets them when it ends.
  void apply_loads(double h) {
    changes_.assign(slots_.size(), {});
    for (const std::uint32_t id : movable_) {
      Slot& slot = slots_[id];
      const Vec3 force = slot.weight + slot.force;
      BodyState state = read_state(slot);
      if (slot.rotates && feels_gyroscopic_torque(slot.inertia)) {
        state.angular_velocity = turned_freely(state.orientation, slot.inertia, state.angular_velocity, h);
        set_velocities(slot, state.linear_velocity, state.angular_velocity);
      }
      changes_[id] =
          open_change(slot.mass, slot.inertia, slot.rotates, accelerated(slot, state, h * force, h * slot.torque));
      if (force.isZero(0.0) && slot.torque.isZero(0.0)) continue;
      wasm::Scratch& scratch = module_.scratch();
      w2c_physx_emscripten_bind_PxRigidDynamic_addForce_1(module_.get(), slot.actor, scratch.put(to_physx(force)));
      w2c_physx_emscripten_bind_PxRigidDynamic_addTorque_1(module_.get(), slot.actor,
                                                           scratch.put(to_physx(slot.torque)));
    }
  }

  template <class T>
  T get(Address at) const {
    return wasm::load<T>(module_.memory(), at);
  }

  BodyState read_state(const Slot& slot) const {
    w2c_physx* m = module_.get();
    const auto pose = get<Transform>(w2c_physx_emscripten_bind_PxRigidActor_getGlobalPose_0(m, slot.actor));
    BodyState state{from_physx(pose.translation), from_physx(pose.rotation), Vec3::Zero(), Vec3::Zero()};
    if (slot.fixed) {
      state.linear_velocity = slot.after.linear_velocity;
      state.angular_velocity = slot.after.angular_velocity;
      return state;
    }
    state.linear_velocity =
        from_physx(get<Float3>(w2c_physx_emscripten_bind_PxRigidBody_getLinearVelocity_0(m, slot.actor)));
    state.angular_velocity =
        from_physx(get<Float3>(w2c_physx_emscripten_bind_PxRigidBody_getAngularVelocity_0(m, slot.actor)));
    return state;
  }

  Box read_bounds(const Slot& slot) const {
    constexpr double kEverywhere = 1e18;
    if (slot.plane) return {Vec3::Constant(-kEverywhere), Vec3::Constant(kEverywhere)};
    const auto box =
        get<Bounds>(w2c_physx_emscripten_bind_PxRigidActor_getWorldBounds_1(module_.get(), slot.actor, 1.0F));
    return {from_physx(box.lower), from_physx(box.upper)};
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
        const auto at = static_cast<Address>(points_ + p * sizeof(ContactPoint));
        const auto point = get<ContactPoint>(at);
        if (from_physx(point.impulse).isZero(0.0) && point.separation > 0.0F) continue;
        reports_.push_back({first, second, point});
      }
    }
  }

  Contact read(const Report& report) const {
    const bool swap = report.first > report.second;
    const std::uint32_t a = swap ? report.second : report.first;
    const std::uint32_t b = swap ? report.first : report.second;
    Contact contact;
    contact.a = BodyId{a};
    contact.b = BodyId{b};
    contact.normal = (swap ? -1.0 : 1.0) * from_physx(report.point.normal);
    contact.point = from_physx(report.point.position);
    contact.distance = report.point.separation;
    contact.normal_impulse = from_physx(report.point.impulse).norm();
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
  std::uint32_t iterations_;
  std::vector<Mesh> meshes_;
  mutable physx::Module module_;  ///< also to read from it, the module writes to its memory
  Address points_;                ///< room for the contact points of a pair
  std::vector<Slot> slots_;
  std::uint64_t count_ = 0;              ///< bodies
  std::vector<std::uint32_t> movable_;   ///< ids, in the order of adding
  std::vector<Report> reports_;          ///< of a sub-step
  double reach_ = 0.05;                  ///< m
  std::vector<VelocityChange> changes_;  ///< of a sub-step, by id
  std::vector<Contact> found_;           ///< of a sub-step
  std::vector<double> friction_;         ///< of found_
  FrictionEstimate estimate_;
  ContactTotals contacts_;
};

const EnginePlugin kPlugin{
    .name = "physx",
    .version = "PhysX 5.6.1 of physx-js-webidl 2.7.3, single precision, TGS",
    .licence = "BSD-3-Clause",
    .presets = kPresets,
    .make = [](const EngineSettings& settings, std::span<const Mesh> meshes) -> std::unique_ptr<Engine> {
      return std::make_unique<Physx>(settings, meshes);
    }};

}  // namespace

}  // namespace subworld

SUBWORLD_ENGINE_PLUGIN(subworld::kPlugin)
