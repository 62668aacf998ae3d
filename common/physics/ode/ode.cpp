#include "body.hpp"
#include "contacts.hpp"
#include "model/error.hpp"
#include "physics/adapter.hpp"
#include "physics/gyroscope.hpp"
#include "position.hpp"
#include "shapes.hpp"

#include <fmt/core.h>

#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <mutex>
#include <utility>

namespace subworld {

namespace {

using ode::inverse_inertia;
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

class Ode final : public Adapter<Slot> {
 public:
  Ode(const EngineSettings& settings, std::span<const Mesh> meshes)
      : Adapter(kPlugin, settings),
        shapes_(meshes),
        world_((enter_thread(), dWorldCreate())),
        space_(dSweepAndPruneSpaceCreate(nullptr, dSAP_AXES_XYZ)),
        points_(world_, space_, slots_, shapes_, settings.gravity.norm(), settings.pairs) {
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
      if (slot.used) remove_from_ode(slot);
    }
    points_.remove_joints();
    dSpaceDestroy(space_);
    dWorldDestroy(world_);
  }
  Ode(const Ode&) = delete;
  Ode& operator=(const Ode&) = delete;

  Capabilities capabilities() const noexcept override {
    return {.normal_impulse = Fidelity::exact,
            .tangential_impulse = Fidelity::exact,
            .gyroscopic = Fidelity::exact,
            .checkpoint = Fidelity::exact,
            .deterministic = true,
            .longest_step_s = 0.002};
  }

  BodyState state(BodyId id) const override { return state_of(at(id)); }

  void step(double dt) override {
    enter_thread();
    step_in_parts(dt, [this](double h, int number) { substep(h, number); });
  }

  Box bounds(BodyId id) const override {
    const Slot& slot = at(id);
    if (slot.shape_kind == ShapeKind::plane) return {Vec3::Constant(-kEverywhere), Vec3::Constant(kEverywhere)};
    Box around;
    for (const ode::Piece& piece : slot.pieces) {
      std::array<dReal, 6> box;
      dGeomGetAABB(piece.geom, box.data());
      const double skin = ode::skin(piece.part.shape.kind);
      const Box one{Vec3(box[0], box[2], box[4]).array() + skin, Vec3(box[1], box[3], box[5]).array() - skin};
      &piece == slot.pieces.data() ? void(around = one) : around.extend(one);
    }
    return around;
  }

 private:
  void create(Slot& slot, const Body& body, const BodyState& state, const CollisionClass& collides) override {
    enter_thread();
    refuse_turning_friction(name(), body, points_.material_pairs());
    if (!body.fixed() && ode::skin(body.shape.kind) == 0.0) {
      throw Error(ExitCode::usage, fmt::format("body {}: a plane or mesh cannot move; give it mass 0", slot.id));
    }
    const BodyPart whole{body.shape, {}, body.material};
    const bool compound = body.shape.kind == ShapeKind::compound;
    for (const BodyPart& part : compound ? shapes_.parts(body.shape) : std::span(&whole, 1)) {
      const std::uint64_t number = ode::Number{slot.id, static_cast<std::uint32_t>(slot.pieces.size())}.packed();
      const ode::Piece& piece =
          slot.pieces.emplace_back(ode::Piece{part, shapes_.make(part.shape), shapes_.make_back(part.shape)});
      dGeomSetData(piece.geom, reinterpret_cast<void*>(static_cast<std::uintptr_t>(number)));
      dGeomSetCategoryBits(piece.geom, collides.member);
      dGeomSetCollideBits(piece.geom, collides.meets);
      dSpaceAdd(space_, piece.geom);
    }
    if (!body.fixed()) ode::make_body(slot, world_);
    ode::place(slot, state);
  }

  static void remove_from_ode(Slot& slot) {
    for (const ode::Piece& piece : slot.pieces) {
      dGeomDestroy(piece.geom);
      if (piece.back) dGeomDestroy(piece.back);
    }
    if (slot.body) dBodyDestroy(slot.body);
  }

  void destroy(Slot& slot) override {
    enter_thread();
    remove_from_ode(slot);
    points_.frictions().forget(slot.id);
  }

  void place(Slot& slot, const BodyState& state) override { ode::place(slot, state); }
  void put_velocity(Slot& slot, const Vec3& linear, const Vec3& angular) override {
    ode::set_velocity(slot, linear, angular);
  }
  void put_inertia(Slot& slot) override { ode::set_mass(slot); }
  void push(Slot& slot, const Vec3& impulse, const Vec3& point) override {
    const BodyState s = state_of(slot);
    const Vec3 turn = inverse_inertia(slot) * (point - s.position).cross(impulse);
    ode::set_velocity(slot, s.linear_velocity + impulse / slot.mass, s.angular_velocity + turn);
  }

  void save_rest(std::span<const SavedBody>, std::vector<std::byte>& to) const override {
    const std::vector<ode::Friction>& held = points_.frictions().held();
    append(held.data(), held.size() * sizeof(ode::Friction), to);
  }
  void restore_rest(std::span<const SavedBody>, std::span<const std::byte> rest) override {
    enter_thread();
    if (rest.size() % sizeof(ode::Friction) != 0) refuse_checkpoint();
    std::vector<ode::Friction> frictions(rest.size() / sizeof(ode::Friction));
    if (!rest.empty()) std::memcpy(frictions.data(), rest.data(), rest.size());
    points_.frictions().restore(std::move(frictions));
  }
  /// ODE solves bodies in the order in which they were made.
  void reorder(std::span<const std::uint32_t> ids) override {
    for (const std::uint32_t id : ids) {
      for (const ode::Piece& piece : slots_[id].pieces) dGeomSetBody(piece.geom, nullptr);
      dBodyDestroy(slots_[id].body);
      ode::make_body(slots_[id], world_);
    }
  }

  void substep(double h, int number) {
    for (const std::uint32_t id : movable_) {
      Slot& slot = slots_[id];
      if (!slot.rotates) {
        dBodySetAngularVel(slot.body, 0, 0, 0);
      } else if (feels_gyroscopic_torque(slot.inertia)) {
        const BodyState s = state_of(slot);
        const Vec3 spin = turned_freely(s.orientation, slot.inertia, s.angular_velocity, h);
        dBodySetAngularVel(slot.body, spin.x(), spin.y(), spin.z());
      }
      const Vec3 force = slot.weight + slot.force;
      dBodyAddForce(slot.body, force.x(), force.y(), force.z());
      if (slot.rotates) dBodyAddTorque(slot.body, slot.torque.x(), slot.torque.y(), slot.torque.z());
    }
    clock_.ends(&EngineTimes::exchange_s);
    points_.find();
    points_.make_joints(h);
    prepare_correction();
    for (const std::uint32_t id : movable_) {
      if (!slots_[id].rotates) slots_[id].kept = state_of(slots_[id]);
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
      if (!apart && slot.rotates) continue;
      const auto& [mass, inertia, shift, turn] = correction_.mover(id);
      BodyState s = state_of(slot);
      if (!slot.rotates) {
        s.orientation = slot.kept.orientation;
        s.angular_velocity = Vec3::Zero();
      }
      s.position += shift;
      if (turn.squaredNorm() > 0.0) {
        s.orientation.coeffs() += 0.5 * (Quat(0.0, turn.x(), turn.y(), turn.z()) * s.orientation).coeffs();
        s.orientation.normalize();
      }
      ode::place(slot, s);
    }
  }

  ode::ShapeStore shapes_;
  dWorldID world_;
  dSpaceID space_;
  ode::ContactPoints points_;
  ode::PositionCorrection correction_;
};

const EnginePlugin kPlugin{.name = "ode",
                           .version = "ODE 0.16, double precision, QuickStep",
                           .licence = "BSD-3-Clause or LGPL-2.1",
                           .presets = kPresets,
                           .make = make_adapter<Ode>};

}  // namespace

}  // namespace subworld

SUBWORLD_ENGINE_PLUGIN(subworld::kPlugin)
