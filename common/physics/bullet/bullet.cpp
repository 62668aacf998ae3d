#include "physics/adapter.hpp"
#include "physics/bullet/contacts/box_box.hpp"
#include "physics/bullet/contacts/box_plane.hpp"
#include "physics/bullet/contacts/convex_contacts.hpp"
#include "physics/bullet/presets.hpp"
#include "physics/bullet/slot.hpp"
#include "physics/bullet/small_steps.hpp"
#include "physics/bullet/solver/contact_solver.hpp"
#include "physics/bullet/solver/joint_set.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

// Bullet stores these in globals; every engine sets its own values before Bullet reads them.
extern btScalar gContactBreakingThreshold;
extern btScalar gDbvtMargin;

namespace subworld {

namespace {

using bullet::from_bullet;
using bullet::scalar;
using bullet::set_pose;
using bullet::set_velocity_of;
using bullet::to_bullet;

// Friction without small steps. Friction that starts from zero in each step lets a held body creep by a small distance
// in each step, so faster with longer steps. Friction that continues from step to step holds a card house, but with few
// iterations per second it makes a tower oscillate: it converges slowly and acts as a spring. A compromise: a long step
// creeps as fast as one of 3 ms, and a tower of twenty stands in steps of 5 ms. With 1 ms the operator feels half the
// error at 4 ms, but the tower drifts.
/// Friction of this time of each step starts from zero, s; only the remaining share continues from the previous step.
constexpr double kFrictionForgotten_s = 3e-3;
constexpr double kFrictionRelaxation = 1.3;  ///< over-relaxation of friction in each iteration
constexpr double kPushOutRatio = 0.2;        ///< share of a penetration that is removed in a step

extern const EnginePlugin kPlugin;

/// Forces the compiler to emit this library's own copies of Bullet's shared static objects (see CMakeLists.txt).
[[gnu::used]] const void* const kOwnStatics[] = {&btTransform::getIdentity(), &btMatrix3x3::getIdentity()};

constexpr int kMostParts = 16;
/// The tree of bounds waits while a body moves within this share of its size, not within Bullet's own 5 cm.
constexpr double kTreeMarginRatio = 0.05;

using bullet::Slot;

class Bullet final : public Adapter<Slot> {
 public:
  Bullet(const EngineSettings& settings, std::span<const Mesh> meshes)
      : Adapter(kPlugin, settings),
        values_(bullet::kPresetValues[find_preset(kPlugin, settings.preset)]),
        fixed_iterations_(settings.iterations),
        pairs_(settings.pairs),
        shapes_(meshes),
        workers_(values_.ahead_s > 0.0 ? settings.threads.value_or(1) : 1),
        configuration_(bullet::collision_settings()),
        dispatcher_(configuration_, values_.ahead_s > 0.0, workers_),
        small_steps_(workers_),
        world_(dispatcher_, broadphase_, chosen_solver(), configuration_, workers_) {
    bullet::register_box_box(dispatcher_);
    bullet::register_convex_contacts(dispatcher_);
    // Bullet's list of persistent points suits a solver that starts friction from zero in each step. Small steps need
    // points that store the impulses of the last sub-step.
    if (!values_.small_steps) bullet::register_box_plane(dispatcher_);
    if (values_.small_steps) world_.leave_moving_to_solver(values_.ahead_s);
    auto& info = world_.getSolverInfo();
    info.m_sor = 1;
    info.m_erp2 = scalar(kPushOutRatio);
    solver_.set_friction_forgotten(scalar(kFrictionForgotten_s));
    solver_.set_friction_relaxation(scalar(kFrictionRelaxation));
    solver_.keep_frictionless(disables(settings.disabled, Optimisation::friction));
    small_steps_.keep_frictionless(disables(settings.disabled, Optimisation::friction));
    small_steps_.set_most_passes(values_.most_spring_passes, values_.most_rigid_passes);
    // Gravity is applied here as a force, so that set_inertia() leaves the weight alone.
    world_.setGravity(btVector3(0, 0, 0));
  }

  ~Bullet() override {
    for (Slot& slot : slots_) {
      if (slot.body) world_.removeRigidBody(slot.body.get());
    }
  }

  Capabilities capabilities() const noexcept override {
    return {.normal_impulse = Fidelity::exact,
            .tangential_impulse = Fidelity::exact,
            .gyroscopic = Fidelity::exact,
            .joints = Fidelity::exact,
            .checkpoint = Fidelity::estimated,  // poses and velocities; the solver's warm start is not saved
            .deterministic = true,
            .precision = std::numeric_limits<btScalar>::epsilon(),
            .longest_step_s = values_.ahead_s > 0.0 ? values_.ahead_s : Capabilities{}.longest_step_s,
            .drives_inside = drives_inside()};
  }

  BodyState state(BodyId id) const override {
    const btRigidBody& body = *at(id).body;
    return {from_bullet(body.getWorldTransform().getOrigin()), from_bullet(body.getWorldTransform().getRotation()),
            from_bullet(body.getLinearVelocity()), from_bullet(body.getAngularVelocity())};
  }

  double integration_substep_s(double dt) const noexcept override {
    const double substep = Adapter::integration_substep_s(dt);
    return values_.small_steps ? substep / bullet::SmallStepSolver::step_count(iterations(substep)) : substep;
  }
  void step(double dt) override { advance(dt, {}, {}); }
  void step_driven(double dt, std::span<const BodyId> driven, const StepDrive& drive) override {
    drives_inside() ? advance(dt, driven, drive) : Engine::step_driven(dt, driven, drive);
  }

  Box bounds(BodyId id) const override { return bounds_of(at(id)); }

  void overlap(const Box& box, std::vector<BodyId>& out) const override {
    // The tree's boxes have a margin, so the bodies' own bounds are tested.
    struct Collect final : btBroadphaseAabbCallback {
      bool process(const btBroadphaseProxy* proxy) override {
        const auto* object = static_cast<const btCollisionObject*>(proxy->m_clientObject);
        if (bullet::box_of(*object).meets(*box)) {
          out->push_back(BodyId{static_cast<std::uint32_t>(object->getUserIndex())});
        }
        return true;
      }
      const Box* box = nullptr;
      std::vector<BodyId>* out = nullptr;
    } collect;
    out.clear();
    follow_moved();
    collect.box = &box;
    collect.out = &out;
    const_cast<btDbvtBroadphase&>(broadphase_).aabbTest(to_bullet(box.lower), to_bullet(box.upper), collect);
    std::sort(out.begin(), out.end());
  }

 private:
  void advance(double dt, std::span<const BodyId> driven, const StepDrive& drive) {
    claim_globals();
    moved_.clear();  // a step begins with updated bounds of all bodies
    step_in_parts(
        dt,
        [&](double h, int number) {
          drive_parts(driven, drive, number * h, h);
          for (const std::uint32_t id : movable_) {
            Slot& slot = slots_[id];
            bullet::put_loads(slot);
            if (slot.gyroscopic) bullet::begin_turn(slot, h);
            if (slot.parts) slot.parts->follow();
          }
          clock_.ends(&EngineTimes::exchange_s);
          world_.getSolverInfo().m_numIterations = iterations(h);
          world_.advance(scalar(h));
          for (const std::uint32_t id : movable_) {
            if (slots_[id].gyroscopic) bullet::end_turn(slots_[id]);
          }
          clock_.ends(&EngineTimes::solving_s);
          collect_contacts(number);
          clock_.ends(&EngineTimes::exchange_s);
        },
        std::max(parts_for_spin(dt), parts_for_drive(driven, dt)));
    small_steps_.driven().bodies.clear();
  }

  void create(Slot& slot, const Body& body, const BodyState& state, const CollisionClass& collides) override {
    claim_globals();
    const btVector3 inertia = body.rotates ? to_bullet(body.inertia) : btVector3(0, 0, 0);
    btRigidBody::btRigidBodyConstructionInfo info(scalar(body.mass), nullptr, shapes_.get(body.shape), inertia);
    // Bullet multiplies the values of a pair: this gives the geometric mean.
    info.m_friction = scalar(std::sqrt(body.material.friction));
    info.m_restitution = scalar(body.material.restitution);
    slot.body = std::make_unique<btRigidBody>(info);
    slot.body->setActivationState(DISABLE_DEACTIVATION);
    slot.body->setFlags(0);  // without Bullet's gyroscopic term, which loses energy and is wrong in single precision
    slot.body->setUserIndex(static_cast<int>(slot.id));
    if (!body.rotates) slot.body->setAngularFactor(btVector3(0, 0, 0));
    slot.gyroscopic = body.rotates && !body.fixed() && feels_gyroscopic_torque(body.inertia);
    set_pose(*slot.body, state);
    if (body.shape.kind == ShapeKind::compound)
      slot.parts = std::make_unique<bullet::Parts>(*slot.body, shapes_.parts(body.shape), pairs_, shapes_);
    if (!pairs_.empty() || body.is_driven() || resists_turning(body.material)) {
      slot.surface = std::make_unique<bullet::Surface>(
          bullet::Surface{body.material, pairs_, to_bullet(body.surface_velocity), to_bullet(body.surface_turn)});
      set_surface(*slot.body, slot.surface.get());
    }
    world_.addRigidBody(slot.body.get(), static_cast<int>(collides.member), static_cast<int>(collides.meets));
    world_.left_contacts().came(*slot.body);
    world_.search_again();
    part_from_group(slot, true);
    if (body.fixed()) return;
    const Box size = bounds_of(slot);
    tree_margin_ = std::min(tree_margin_, kTreeMarginRatio * (size.upper - size.lower).minCoeff());
  }

  void destroy(Slot& slot) override {
    world_.left_contacts().keep(*slot.body, dispatcher_);
    world_.search_again();
    part_from_group(slot, false);
    world_.removeRigidBody(slot.body.get());
  }

  // Removing a body searches all pairs for its own.
  void part(std::span<const BodyId> ids) override {
    for (const BodyId id : ids) at(id).body->setUserIndex2(bullet::kLeaves);
    world_.left_contacts().keep_leaving(dispatcher_);
    world_.part_leaving();
  }

  void part_from_group(Slot& slot, bool parts) {
    if (slot.group == 0) return;
    for (Slot& other : slots_) {
      if (!other.used || other.id == slot.id || other.group != slot.group) continue;
      other.body->setIgnoreCollisionCheck(slot.body.get(), parts);
      slot.body->setIgnoreCollisionCheck(other.body.get(), parts);
    }
  }

  void place(Slot& slot, const BodyState& state) override {
    set_pose(*slot.body, state);
    if (slot.parts) slot.parts->follow();
    world_.search_again();
    moved_.push_back(BodyId{slot.id});
  }

  void put_velocity(Slot& slot, const Vec3& linear, const Vec3& angular) override {
    set_velocity_of(*slot.body, linear, angular);
  }

  void put_inertia(Slot& slot) override {
    slot.gyroscopic = slot.rotates && feels_gyroscopic_torque(slot.inertia);
    slot.body->setMassProps(scalar(slot.mass), slot.rotates ? to_bullet(slot.inertia) : btVector3(0, 0, 0));
    slot.body->updateInertiaTensor();
  }

  void push(Slot& slot, const Vec3& impulse, const Vec3& point) override {
    slot.body->applyImpulse(to_bullet(impulse), to_bullet(point) - slot.body->getCenterOfMassPosition());
  }

  void require(const Joint&) const override {}
  void connect(std::size_t j) override {
    joint_set_.add(j, joints_[j], *at(joints_[j].a).body, *at(joints_[j].b).body);
  }
  void disconnect(std::size_t j) override { joint_set_.remove(j); }
  JointLoad take_load(std::size_t j) override { return joint_set_.take_load(j); }

  static Box bounds_of(const Slot& slot) { return bullet::box_of(*slot.body); }

  [[nodiscard]] int iterations(double h) const noexcept {
    return iteration_count(h, fixed_iterations_, preset_.iterations, preset_.longest_iteration_s);
  }

  btConstraintSolver& chosen_solver() {
    if (values_.small_steps) return small_steps_;
    return solver_;
  }

  void claim_globals() const {
    gContactBreakingThreshold = scalar(values_.contact_breaking_threshold);
    gDbvtMargin = scalar(tree_margin_);
  }

  /// Updates the tree of bounds for bodies that were moved since the last step.
  void follow_moved() const {
    claim_globals();
    for (const BodyId id : moved_) {
      if (contains(id)) const_cast<bullet::SmallStepWorld&>(world_).updateSingleAabb(at(id).body.get());
    }
    moved_.clear();
  }

  [[nodiscard]] int parts_for_spin(double dt) const {
    double most_rad = 0.0;
    for (const std::uint32_t id : movable_) most_rad = std::max(most_rad, bullet::sweeping_turn(slots_[id], dt));
    return std::min(kMostParts, static_cast<int>(std::ceil(most_rad / bullet::kStraightTurn_rad)));
  }

  /// Bodies that are joined are solved mechanism by mechanism.
  [[nodiscard]] bool drives_inside() const noexcept { return values_.ahead_s > 0.0 && joints_.empty(); }
  [[nodiscard]] bool drives_inside(std::span<const BodyId> driven) const {
    return drives_inside() && std::ranges::none_of(driven, [this](BodyId id) { return at(id).gyroscopic; });
  }
  [[nodiscard]] int parts_for_drive(std::span<const BodyId> driven, double dt) const {
    if (driven.empty() || drives_inside(driven)) return 1;
    return static_cast<int>(std::ceil(dt / Capabilities{}.longest_step_s));
  }
  /// Drives the bodies for a sub-step of `h` that begins at `since_s`, or for each of its small steps.
  void drive_parts(std::span<const BodyId> driven, const StepDrive& drive, double since_s, double h) {
    small_steps_.driven().bodies.clear();
    if (driven.empty()) return;
    const bool inside = drives_inside(driven);
    driving_ = {driven, &drive, since_s, inside ? h / bullet::SmallStepSolver::step_count(iterations(h)) : h};
    drive_part(0);
    if (!inside) return;
    for (const BodyId id : driven) small_steps_.driven().bodies.push_back(at(id).body.get());
    small_steps_.driven().drive = [this](int small_step) {
      drive_part(small_step);
      for (const BodyId id : driving_.bodies) bullet::put_loads(at(id));
    };
  }
  void drive_part(int part) {
    const auto& [bodies, drive, since_s, length_s] = driving_;
    for (const BodyId id : bodies) at(id).force = at(id).torque = Vec3::Zero();
    (*drive)(since_s + (part + 1) * length_s, length_s);
  }
  void collect_contacts(int substep) {
    for (int m = 0; m < dispatcher_.getNumManifolds(); ++m) {
      const btPersistentManifold& manifold = *dispatcher_.getManifoldByIndexInternal(m);
      const auto& first = *static_cast<const btRigidBody*>(manifold.getBody0());
      const auto& second = *static_cast<const btRigidBody*>(manifold.getBody1());
      const bool swap = first.getUserIndex() > second.getUserIndex();
      for (int p = 0; p < manifold.getNumContacts(); ++p) {
        const Contact contact = swap ? bullet::contact_of(second, first, manifold.getContactPoint(p), -1.0)
                                     : bullet::contact_of(first, second, manifold.getContactPoint(p), 1.0);
        if (contact.normal_impulse <= 0.0 && contact.distance > 0.0) continue;
        // Points move with the bodies between sub-steps, so the tolerance is larger than Bullet's own.
        contacts_.add(contact, substep, 5.0 * manifold.getContactBreakingThreshold());
      }
    }
  }

  const bullet::PresetValues& values_;
  double tree_margin_ = 0.05;  ///< m
  std::optional<int> fixed_iterations_;
  const std::vector<MaterialPair> pairs_;
  bullet::ShapeStore shapes_;
  Workers workers_;
  btDefaultCollisionConfiguration configuration_;
  bullet::Dispatcher dispatcher_;
  btDbvtBroadphase broadphase_;
  bullet::ContactSolver solver_;
  bullet::SmallStepSolver small_steps_;
  bullet::SmallStepWorld world_;
  bullet::JointSet joint_set_{world_};
  struct Driving {
    std::span<const BodyId> bodies;
    const StepDrive* drive = nullptr;
    double since_s = 0.0;              ///< beginning of the sub-step
    double length_s = 0.0;             ///< length of the parts
  } driving_;                          ///< in the sub-step under way
  mutable std::vector<BodyId> moved_;  ///< set since the last step, not yet in the tree
};

const EnginePlugin kPlugin{
#ifdef BT_USE_DOUBLE_PRECISION
    .name = "bullet",
    .version = "Bullet 3.24, double precision",
#else
    .name = "bullet_float",
    .version = "Bullet 3.24, single precision",
#endif
    .licence = "zlib",
    .presets = bullet::kPresets,
    .limits = {.continuous = true},
    .make = make_adapter<Bullet>};

}  // namespace

}  // namespace subworld

SUBWORLD_ENGINE_PLUGIN(subworld::kPlugin)
