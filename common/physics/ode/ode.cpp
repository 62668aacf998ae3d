#include "body.hpp"
#include "checkpoint.hpp"
#include "contacts.hpp"
#include "model/error.hpp"
#include "physics/contact_totals.hpp"
#include "physics/gyroscope.hpp"
#include "physics/plugin.hpp"
#include "position.hpp"
#include "shapes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <mutex>
#include <utility>

namespace subworld {

namespace {

using ode::inverse_inertia;
using ode::place;
using ode::Slot;
using ode::state_of;

// QuickStep starts from zero at every step, so tall stacks need short steps as well as iterations.
constexpr SubstepCost kCost{.step_s = 4e-6, .body_s = 0.3e-6, .contact_s = 1.0e-6, .contact_iteration_s = 0.05e-6};
constexpr EnginePreset kPresets[] = {
    {.name = "fast",
     .what = "20 iterations, no sub-steps: a heap at haptic rates",
     .iterations = 20,
     .cost = kCost,
     .heavy_on_light = {30, 6}},
    {.name = "quality",
     .what = "60 iterations, sub-steps of at most 1 ms: stacks of ten",
     .iterations = 60,
     .longest_substep_s = 1.05e-3,
     .cost = kCost,
     .heavy_on_light = {56, 56}},
};

extern const EnginePlugin kPlugin;

constexpr int kCorrectionRounds = 8;  ///< of the position correction
constexpr unsigned long kSeed = 1;
constexpr double kEverywhere = 1e18;  ///< m, reach of a plane's bounds

/// ODE ends the process if one of its numbers is not finite. This handler ends the run with a message instead.
void report_failure(int /*number*/, const char* format, va_list arguments) {
  std::array<char, 200> text{};
  std::vsnprintf(text.data(), text.size(), format, arguments);
  throw Error(ExitCode::failed, fmt::format("ode: a state is no longer finite ({}); take shorter steps, preset quality "
                                            "or another engine",
                                            text.data()));
}

/// ODE has data for each thread; call wherever an engine may be used by a new one.
void enter_thread() {
  static const int ready = [] {
    dSetDebugHandler(report_failure);
    dSetErrorHandler(report_failure);
    return dInitODE2(dInitFlagManualThreadCleanup);
  }();
  struct ThreadData {
    ThreadData() { dAllocateODEDataForThread(dAllocateMaskAll); }
    ~ThreadData() { dCleanupODEAllDataForThread(); }
  };
  (void)ready;
  thread_local const ThreadData data;
  (void)data;
}

class Ode final : public Engine {
 public:
  Ode(const EngineSettings& settings, std::span<const Mesh> meshes)
      : preset_(kPresets[find_preset(kPlugin, settings.preset)]),
        gravity_(settings.gravity),
        fixed_substeps_(settings.substeps),
        longest_substep_s_(settings.longest_substep_s.value_or(preset_.longest_substep_s)),
        shapes_(meshes),
        world_((enter_thread(), dWorldCreate())),
        space_(dSweepAndPruneSpaceCreate(nullptr, dSAP_AXES_XYZ)),
        points_(world_, space_, slots_, shapes_, settings.gravity.norm()) {
    dSpaceSetCleanup(space_, 0);
    dWorldSetQuickStepNumIterations(world_, settings.iterations.value_or(preset_.iterations));
    dWorldSetAutoDisableFlag(world_, 0);
    // Contacts are rigid. PositionCorrection removes penetration instead of ODE.
    dWorldSetERP(world_, 0.0);
    dWorldSetCFM(world_, 0.0);
    // Gravity is applied here as a force, so that set_inertia() does not change the weight.
    dWorldSetGravity(world_, 0, 0, 0);
  }

  ~Ode() override {
    enter_thread();
    for (Slot& slot : slots_) {
      if (slot.used) ode::destroy(slot);
    }
    points_.remove_joints();
    dSpaceDestroy(space_);
    dWorldDestroy(world_);
  }
  Ode(const Ode&) = delete;
  Ode& operator=(const Ode&) = delete;

  std::string_view name() const noexcept override { return "ode"; }

  Capabilities capabilities() const noexcept override {
    return {.normal_impulse = Fidelity::exact,
            .tangential_impulse = Fidelity::exact,
            .gyroscopic = Fidelity::exact,
            .checkpoint = Fidelity::exact,
            .deterministic = true,
            .longest_step_s = 0.002};
  }

  void add(const Body& body, const BodyState& state, Role role) override {
    enter_thread();
    const std::uint32_t id = index(body.id);
    if (contains(body.id)) throw Error(ExitCode::failed, fmt::format("body {} is in the engine already", id));
    if (!finite(state)) throw Error(ExitCode::failed, fmt::format("body {} has a state that is not finite", id));
    if (!body.fixed() && ode::skin(body.shape.kind) == 0.0) {
      throw Error(ExitCode::usage, fmt::format("body {}: a plane or mesh cannot move; give it mass 0", id));
    }
    const dGeomID geom = shapes_.make(body.shape);
    if (id >= slots_.size()) slots_.resize(id + 1);
    Slot& slot = slots_[id];
    slot = {};
    slot.used = true;
    slot.spec = body;
    slot.kind = role == Role::ghost         ? ode::kGhosts
                : role == Role::approaching ? ode::kApproaching
                : body.fixed()              ? ode::kFixed
                                            : ode::kMovable;
    slot.geom = geom;
    slot.mass = body.mass;
    slot.inertia = body.inertia;
    if (body.gravity && !body.fixed()) slot.weight = body.mass * gravity_;
    dGeomSetData(geom, reinterpret_cast<void*>(static_cast<std::uintptr_t>(id)));
    dGeomSetCategoryBits(geom, slot.kind.category);
    dGeomSetCollideBits(geom, slot.kind.meets);
    dSpaceAdd(space_, geom);
    if (!body.fixed()) {
      ode::make_body(slot, world_);
      movable_.push_back(id);
    }
    place(slot, state);
    contacts_.clear();
  }

  void remove(BodyId id) override {
    enter_thread();
    Slot& slot = at(id);
    ode::destroy(slot);
    slot = {};
    std::erase(movable_, index(id));
    points_.frictions().forget(index(id));
    contacts_.clear();
  }

  bool contains(BodyId id) const noexcept override { return index(id) < slots_.size() && slots_[index(id)].used; }

  BodyState state(BodyId id) const override { return state_of(at(id)); }

  bool set_state(BodyId id, const BodyState& state) override {
    if (!finite(state)) return false;
    place(at(id), state);
    return true;
  }

  bool set_velocity(BodyId id, const Vec3& linear, const Vec3& angular) override {
    if (!linear.allFinite() || !angular.allFinite()) return false;
    ode::set_velocity(at(id), linear, angular);
    return true;
  }

  void set_inertia(BodyId id, double mass, const Vec3& inertia) override {
    Slot& slot = at(id);
    if (!slot.body) return;
    slot.mass = mass;
    slot.inertia = inertia;
    ode::set_mass(slot);
  }

  bool apply_impulse(BodyId id, const Vec3& impulse, const Vec3& point) override {
    if (!impulse.allFinite() || !point.allFinite()) return false;
    Slot& slot = at(id);
    if (!slot.body) return true;
    const BodyState s = state_of(slot);
    const Vec3 turn = inverse_inertia(slot) * (point - s.position).cross(impulse);
    ode::set_velocity(slot, s.linear_velocity + impulse / slot.mass, s.angular_velocity + turn);
    return true;
  }

  bool apply_force(BodyId id, const Vec3& force, const Vec3& torque) override {
    if (!force.allFinite() || !torque.allFinite()) return false;
    Slot& slot = at(id);
    slot.force += force;
    slot.torque += torque;
    return true;
  }

  double integration_substep_s(double dt) const noexcept override {
    return dt / substep_count(dt, fixed_substeps_, longest_substep_s_);
  }
  void step(double dt) override {
    enter_thread();
    const int substeps = substep_count(dt, fixed_substeps_, longest_substep_s_);
    contacts_.clear();
    clock_.start();
    for (int i = 0; i < substeps; ++i) substep(dt / substeps, i);
    for (const std::uint32_t id : movable_) slots_[id].force = slots_[id].torque = Vec3::Zero();
    contacts_.merge();
    clock_.ends(&EngineTimes::totals_s);
  }

  std::span<const Contact> contacts() const noexcept override { return contacts_.contacts(); }

  Box bounds(BodyId id) const override {
    const Slot& slot = at(id);
    if (slot.spec.shape.kind == ShapeKind::plane) return {Vec3::Constant(-kEverywhere), Vec3::Constant(kEverywhere)};
    std::array<dReal, 6> box;
    dGeomGetAABB(slot.geom, box.data());
    const double skin = ode::skin(slot.spec.shape.kind);
    return {Vec3(box[0], box[2], box[4]).array() + skin, Vec3(box[1], box[3], box[5]).array() - skin};
  }

  void overlap(const Box& box, std::vector<BodyId>& out) const override {
    out.clear();
    for (std::uint32_t id = 0; id < slots_.size(); ++id) {
      if (slots_[id].used && bounds(BodyId{id}).meets(box)) out.push_back(BodyId{id});
    }
  }

  Checkpoint checkpoint() const override {
    // The order of adding is ODE's order of solving, so it is part of the state.
    std::vector<std::uint32_t> ids = movable_;
    for (std::uint32_t id = 0; id < slots_.size(); ++id) {
      if (slots_[id].used && !slots_[id].body) ids.push_back(id);
    }
    ode::Saved saved;
    for (const std::uint32_t id : ids) {
      const Slot& slot = slots_[id];
      const BodyState s = state_of(slot);
      ode::SavedBody& entry = saved.bodies.emplace_back(ode::SavedBody{id, {}, {}});
      Eigen::Map<Eigen::Matrix<double, 13, 1>>(entry.state.data()) << s.position, s.orientation.coeffs(),
          s.linear_velocity, s.angular_velocity;
      Eigen::Map<Eigen::Matrix<double, 10, 1>>(entry.load.data()) << slot.mass, slot.inertia, slot.force, slot.torque;
    }
    saved.frictions = points_.frictions().held();
    return ode::pack(saved);
  }

  void restore(const Checkpoint& checkpoint) override {
    enter_thread();
    ode::Saved saved = ode::unpack(checkpoint);
    if (!fits(saved.bodies)) ode::refuse_checkpoint();
    std::vector<std::uint32_t> order;
    for (const ode::SavedBody& entry : saved.bodies) {
      if (slots_[entry.id].body) order.push_back(static_cast<std::uint32_t>(entry.id));
    }
    if (order != movable_) {
      for (const std::uint32_t id : order) {
        dGeomSetBody(slots_[id].geom, nullptr);
        dBodyDestroy(slots_[id].body);
        ode::make_body(slots_[id], world_);
      }
      movable_ = order;
    }
    for (const ode::SavedBody& entry : saved.bodies) {
      Slot& slot = slots_[entry.id];
      const Eigen::Map<const Eigen::Matrix<double, 13, 1>> x(entry.state.data());
      const Eigen::Map<const Eigen::Matrix<double, 10, 1>> load(entry.load.data());
      slot.mass = load[0];
      slot.inertia = load.segment<3>(1);
      slot.force = load.segment<3>(4);
      slot.torque = load.segment<3>(7);
      if (slot.body) ode::set_mass(slot);
      place(slot, {x.segment<3>(0), Quat(x[6], x[3], x[4], x[5]), x.segment<3>(7), x.segment<3>(10)});
    }
    points_.frictions().restore(std::move(saved.frictions));
    contacts_.clear();
  }

 private:
  Slot& at(BodyId id) { return const_cast<Slot&>(std::as_const(*this).at(id)); }
  const Slot& at(BodyId id) const {
    if (!contains(id)) throw Error(ExitCode::failed, fmt::format("body {} is not in the engine", index(id)));
    return slots_[index(id)];
  }

  void substep(double h, int number) {
    for (const std::uint32_t id : movable_) {
      Slot& slot = slots_[id];
      if (!slot.spec.rotates) {
        dBodySetAngularVel(slot.body, 0, 0, 0);
      } else if (feels_gyroscopic_torque(slot.inertia)) {
        const BodyState s = state_of(slot);
        const Vec3 spin = turned_freely(s.orientation, slot.inertia, s.angular_velocity, h);
        dBodySetAngularVel(slot.body, spin.x(), spin.y(), spin.z());
      }
      const Vec3 force = slot.weight + slot.force;
      dBodyAddForce(slot.body, force.x(), force.y(), force.z());
      if (slot.spec.rotates) dBodyAddTorque(slot.body, slot.torque.x(), slot.torque.y(), slot.torque.z());
    }
    clock_.ends(&EngineTimes::exchange_s);
    points_.find();
    points_.make_joints(h);
    prepare_correction();
    for (const std::uint32_t id : movable_) {
      if (!slots_[id].spec.rotates) slots_[id].kept = state_of(slots_[id]);
    }
    {
      // QuickStep shuffles its rows with random numbers that all worlds of the process share.
      static std::mutex shared_random;
      const std::lock_guard lock(shared_random);
      dRandSetSeed(kSeed);
      dWorldQuickStep(world_, h);
    }
    points_.remove_joints();
    move_apart();
    clock_.ends(&EngineTimes::solving_s);
    points_.collect(h, number, contacts_);
    clock_.ends(&EngineTimes::exchange_s);
  }

  void prepare_correction() {
    correction_.clear(slots_.size());
    for (const std::uint32_t id : movable_) {
      correction_.mover(id).inverse_mass = 1.0 / slots_[id].mass;
      correction_.mover(id).inverse_inertia = inverse_inertia(slots_[id]);
    }
    for (const ode::ContactPoint& p : points_.found()) {
      correction_.add(p.a, p.b, p.point - state_of(slots_[p.a]).position, p.point - state_of(slots_[p.b]).position,
                      p.normal, p.distance);
    }
  }

  /// Call after ODE's step: restores the orientation of bodies that do not rotate, and reduces penetration.
  void move_apart() {
    const bool apart = correction_.solve(kCorrectionRounds);
    for (const std::uint32_t id : movable_) {
      Slot& slot = slots_[id];
      if (!apart && slot.spec.rotates) continue;
      const auto& [mass, inertia, shift, turn] = correction_.mover(id);
      BodyState s = state_of(slot);
      if (!slot.spec.rotates) {
        s.orientation = slot.kept.orientation;
        s.angular_velocity = Vec3::Zero();
      }
      s.position += shift;
      if (turn.squaredNorm() > 0.0) {
        s.orientation.coeffs() += 0.5 * (Quat(0.0, turn.x(), turn.y(), turn.z()) * s.orientation).coeffs();
        s.orientation.normalize();
      }
      place(slot, s);
    }
  }

  /// Whether the engine has the saved bodies.
  bool fits(const std::vector<ode::SavedBody>& bodies) const {
    const auto held = std::count_if(slots_.begin(), slots_.end(), [](const Slot& slot) { return slot.used; });
    return static_cast<std::ptrdiff_t>(bodies.size()) == held &&
           std::all_of(bodies.begin(), bodies.end(), [this](const ode::SavedBody& entry) {
             const auto id = static_cast<std::uint32_t>(entry.id);
             return contains(BodyId{id}) && (slots_[id].body != nullptr) == (entry.load[0] > 0.0);
           });
  }

  const EnginePreset& preset_;
  Vec3 gravity_;
  std::optional<int> fixed_substeps_;
  double longest_substep_s_;
  ode::ShapeStore shapes_;
  dWorldID world_;
  dSpaceID space_;
  std::vector<Slot> slots_;
  std::vector<std::uint32_t> movable_;  ///< ids, in the order of adding
  ode::ContactPoints points_;
  ode::PositionCorrection correction_;
  ContactTotals contacts_;
};

const EnginePlugin kPlugin{
    .name = "ode",
    .version = "ODE 0.16, double precision, QuickStep",
    .licence = "BSD-3-Clause or LGPL-2.1",
    .presets = kPresets,
    .make = [](const EngineSettings& settings, std::span<const Mesh> meshes) -> std::unique_ptr<Engine> {
      return std::make_unique<Ode>(settings, meshes);
    }};

}  // namespace

}  // namespace subworld

SUBWORLD_ENGINE_PLUGIN(subworld::kPlugin)
