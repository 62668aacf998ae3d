#include "model/shapes/shape_extent.hpp"
#include "physics/wasm/module_engine.hpp"
#include "rapier_module.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace subworld {

namespace {

using namespace rapier;

// Symbols: h an iteration (s), w = 2 pi f of a contact's spring, z its damping ratio, g gravity, n bodies carried.
// Rapier's contacts are springs. Under load the penetration is n g / w^2, whatever z is, and it recovers at a rate of w
// / (h w + 2 z) per second. Each iteration is a time step, so h and w, and not the engine's step, decide the stiffness
// and depth of a contact. Both are the same in a world's steps and a sub-world's, so bodies that change from one to the
// other do not jump.
//
// Chosen with a stack of 50 cubes of 1 m, cubes on cubes of 1:100 to 1:3000 of their mass, heaps of 60 and 200 cubes,
// and an operator in a heap whose world uses another engine, in steps of 1 ms. With w h = 1.6 the stack's top rests 3
// mm deep, 1:1000 rests 2 mm deep, and rigid engines agree to 2 %. With 3.1, 1:100 trembles by 95 mm/s. With 0.8 all
// depths are four times as large, Havok agrees to 7 %, and a third as many cubes jump out that ghosts squeeze; with
// 0.4, none does. z = 3 throws apart a heap that begins too deep, at 0.2 m/s; z = 30 lets 1:100 tremble by 27 mm/s.
constexpr double kAngle = 0.25;    ///< f h
constexpr float kDamping = 10.0F;  ///< z

/// Contacts are searched once a sub-step. In steps of 17 ms those of a house of cards are lost before the next search,
/// and it bursts.
constexpr double kLongestSubstep_s = 4.2e-3;

constexpr SubstepCost kCost{.step_s = 3e-6, .body_s = 0.25e-6, .contact_s = 0.3e-6, .contact_iteration_s = 0.07e-6};
constexpr EnginePreset kPresets[] = {
    {.name = "fast",
     .what = "iterations of at most 0.5 ms, each a small time step of its own; contacts are springs of 500 Hz",
     .iterations = 1,
     .longest_substep_s = kLongestSubstep_s,
     .longest_iteration_s = 0.525e-3,
     .cost = kCost,
     .heavy_on_light = {2700, 2700}},
    {.name = "quality",
     .what = "iterations of at most 0.25 ms, each a small time step of its own; contacts are springs of 1000 Hz",
     .iterations = 1,
     .longest_substep_s = kLongestSubstep_s,
     .longest_iteration_s = 0.2625e-3,
     .cost = kCost,
     .heavy_on_light = {10000, 10000}},
};

extern const EnginePlugin kPlugin;

/// Distance at which contacts are searched; larger for bodies that move more than half of it in a step. All contacts
/// found are solved: with 2 mm, a step of cubes that are 0.5 mm apart takes twice as long.
constexpr double kPrediction = 0.0005;  ///< units of length
constexpr float kFar = 1e3F;

/// Pairs that have moved less since the last search reuse their points, which move with the bodies. A fifth of a
/// millimetre is 0.2 degrees for a cube of 0.1 m. Without reuse, a step of a resting heap takes twice as long.
constexpr float kRecycleDistance = 2e-4F;  ///< units of length

constexpr std::size_t kAhead = 4;  ///< prefetch distance in pairs or manifolds

/// Index of a contact's point; the remaining bit marks new ones.
constexpr std::uint32_t kPointMask = 0x7FFFFFFF;

class Rapier final : public wasm::ModuleEngine {
 public:
  Rapier(const EngineSettings& settings, std::span<const Mesh> meshes)
      : ModuleEngine(kPlugin, settings, meshes), fixed_iterations_(settings.iterations) {
    Parameters& p = module_.parameters();
    p.damping = p.fixed_damping = kDamping;
    p.speed_limit = std::numeric_limits<float>::max();
    p.prediction = static_cast<float>(kPrediction);
    p.recycle_distance = kRecycleDistance;
    p.clusters_contacts = 0;  // clusters would be solved in another array
  }

  double integration_substep_s(double dt) const noexcept override {
    const double h = ModuleEngine::integration_substep_s(dt);
    return h / iterations(h);
  }

 private:
  int iterations(double h) const noexcept {
    return iteration_count(h, fixed_iterations_, preset_.iterations, preset_.longest_iteration_s);
  }

  wasm_rt_memory_t& memory() const override { return module_.memory(); }

  void make(Slot& slot, const Body& body, const BodyState& state, const CollisionClass& collides) override {
    const Address shape = module_.make_shape(body.shape, meshes_);          // first: if it fails, nothing is added
    slot.body = bits(module_.make_body(body, state, shape, collides)) + 1;  // + 1, because a handle may be zero
    if (!slot.fixed) put_inertia(slot);
    if (slot.id >= known_.size()) known_.resize(slot.id + 1);
    known_[slot.id] = {.bounds = subworld::bounds(body.shape, {}, meshes_)};
    identify(slot);
  }

  void destroy(Slot& slot) override { module_.remove(handle(slot)); }

  void put_inertia(Slot& slot) override {
    // Zero: does not rotate.
    w2c_rapier_rawrigidbodyset_rbSetAdditionalMassProperties(
        module_.get(), module_.bodies(), handle(slot), static_cast<float>(slot.mass), module_.zero(),
        module_.first(slot.rotates ? slot.inertia : Vec3::Zero()), module_.unturned(), 1);
  }

  void put_pose(const Slot& slot, const Vec3& position, const Quat& orientation) override {
    const Float3 x = to_module(position);
    const Float4 q = to_module(orientation);
    w2c_rapier_rawrigidbodyset_rbSetTranslation(module_.get(), module_.bodies(), handle(slot), x.x, x.y, x.z, 1);
    w2c_rapier_rawrigidbodyset_rbSetRotation(module_.get(), module_.bodies(), handle(slot), q.x, q.y, q.z, q.w, 1);
  }

  void put_velocities(const Slot& slot, const Vec3& linear, const Vec3& angular) override {
    w2c_rapier_rawrigidbodyset_rbSetLinvel(module_.get(), module_.bodies(), handle(slot), module_.first(linear), 1);
    w2c_rapier_rawrigidbodyset_rbSetAngvel(module_.get(), module_.bodies(), handle(slot), module_.second(angular), 1);
  }

  /// Rapier applies forces until they are removed, so only changes are passed.
  void load(const Slot& slot, const wasm::Load& load) override {
    if (load.turned) put_velocities(slot, load.now.linear_velocity, load.now.angular_velocity);
    w2c_rapier* m = module_.get();
    Known& known = known_[slot.id];
    const bool hurries = load.h * load.loaded.linear_velocity.norm() > 0.5 * kPrediction;
    if (known.in_module && known.hurries == hurries && known.force == load.force && known.torque == slot.torque) return;
    const Handle body = handle(slot);
    w2c_rapier_rawrigidbodyset_rbSetSoftCcdPrediction(m, module_.bodies(), body, hurries ? kFar : 0.0F);
    w2c_rapier_rawrigidbodyset_rbResetForces(m, module_.bodies(), body, 0);
    w2c_rapier_rawrigidbodyset_rbResetTorques(m, module_.bodies(), body, 0);
    w2c_rapier_rawrigidbodyset_rbAddForce(m, module_.bodies(), body, module_.first(load.force), 1);
    w2c_rapier_rawrigidbodyset_rbAddTorque(m, module_.bodies(), body, module_.second(slot.torque), 1);
    known = {.bounds = known.bounds, .in_module = true, .hurries = hurries, .force = load.force, .torque = slot.torque};
  }

  BodyState read(const Slot& slot) const override {
    const RigidBody& body = module_.body(handle(slot));
    return {from_module(body.translation), from_module(body.rotation), from_module(body.linear_velocity),
            from_module(body.angular_velocity)};
  }

  Box read_bounds(const Slot& slot) const override {
    const Box& local = known_[slot.id].bounds;
    const BodyState state = slot.known ? slot.after : read(slot);
    const Eigen::Matrix3d turn = state.orientation.toRotationMatrix();
    const Vec3 centre = state.position + turn * (0.5 * (local.lower + local.upper));
    const Vec3 half = turn.cwiseAbs() * (0.5 * (local.upper - local.lower));
    return {centre - half, centre + half};
  }

  void simulate(double h) override {
    const int count = iterations(h);
    // Stiffness of the preset's own iterations, or the largest that longer ones permit.
    const double iteration_s = std::max(h / count, preset_.longest_iteration_s);
    Parameters& p = module_.parameters();
    p.dt = static_cast<float>(h);
    p.smallest_ccd_step = 0.01F * p.dt;
    p.iterations = static_cast<std::uint32_t>(count);
    p.frequency = p.fixed_frequency = static_cast<float>(kAngle / iteration_s);
    module_.step();
  }

  /// Pairs, manifolds and points are in separate arrays: prefetches the next ones while one is read.
  void collect() override {
    const std::span<const ContactPair> pairs = module_.pairs();
    touching_.clear();
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      if (i + kAhead < pairs.size()) fetch(module_.view<Manifold>(pairs[i + kAhead].manifolds));
      for (const Manifold& manifold : module_.view<Manifold>(pairs[i].manifolds)) {
        if (manifold.solved.count > 0) touching_.push_back(&manifold);
      }
    }
    for (std::size_t i = 0; i < touching_.size(); ++i) {
      if (i + kAhead < touching_.size()) {
        fetch(module_.view<SolvedContact>(touching_[i + kAhead]->solved));
        fetch(module_.view<Point>(touching_[i + kAhead]->points));
      }
      collect(*touching_[i]);
    }
  }

  template <class T>
  static void fetch(std::span<T> items) {
    constexpr std::size_t kCacheLine = 64;
    const auto bytes = std::as_bytes(items);
    for (std::size_t i = 0; i < bytes.size(); i += kCacheLine) __builtin_prefetch(&bytes[i]);
  }

  void collect(const Manifold& manifold) {
    const std::span<const SolvedContact> solved = module_.view<SolvedContact>(manifold.solved);
    const std::span<Point> points = module_.view<Point>(manifold.points);
    // Rapier solves one friction for all points and reports its last iteration; the step's friction is about this
    // multiple of it.
    float last = 0.0F;
    for (const SolvedContact& contact : solved) last += points[contact.point & kPointMask].last;
    Vec3 friction = Vec3::Zero();
    if (last > 0.0F) friction = from_module(points[0].last_tangential) / last;

    const Slot& first = slots_[ids_[manifold.bodies[0].index]];
    const Slot& second = slots_[ids_[manifold.bodies[1].index]];
    const bool swap = first.id > second.id;
    const Vec3 normal = from_module(manifold.normal);
    const Anchors on_first(first), on_second(second);
    for (const SolvedContact& contact : solved) {
      Point& point = points[contact.point & kPointMask];
      const double impulse = std::max(0.0F, point.impulse - point.carried);
      point.carried = point.last;
      const Vec3 p = on_first.point(contact.anchors[0]), q = on_second.point(contact.anchors[1]);
      const double distance = (q - p).dot(normal);
      if (swap) {
        found(second.id, first.id, p, normal, distance, impulse, -impulse * friction);
      } else {
        found(first.id, second.id, q, -normal, distance, impulse, impulse * friction);
      }
    }
  }

  /// A body's contact anchors after the sub-step, in the world's frame.
  class Anchors {
   public:
    explicit Anchors(const Slot& slot) {
      if (slot.fixed) return;  // Rapier stores them in the world's frame
      origin_ = slot.after.position;
      turn_ = slot.after.orientation.toRotationMatrix();
    }
    [[nodiscard]] Vec3 point(const Float3& anchor) const { return origin_ + turn_ * from_module(anchor); }

   private:
    Vec3 origin_ = Vec3::Zero();
    Eigen::Matrix3d turn_ = Eigen::Matrix3d::Identity();
  };

  void handles_changed() override {
    for (const Slot& slot : slots_) {
      if (!slot.used) continue;
      known_[slot.id].in_module = false;
      identify(slot);
    }
  }

  void identify(const Slot& slot) {
    const std::uint32_t place = index_of(handle(slot));
    if (place >= ids_.size()) ids_.resize(place + 1);
    ids_[place] = slot.id;
  }

  static Handle handle(const Slot& slot) { return std::bit_cast<Handle>(slot.body - 1); }

  struct Known {
    Box bounds;              ///< in the body's frame
    bool in_module = false;  ///< the module has the following values
    bool hurries = false;    ///< contacts are searched at a larger distance
    Vec3 force = Vec3::Zero();
    Vec3 torque = Vec3::Zero();
  };

  std::optional<int> fixed_iterations_;
  mutable rapier::Module module_;          ///< its views of memory are not const
  std::vector<Known> known_;               ///< by body
  std::vector<const Manifold*> touching_;  ///< of the current step
  std::vector<std::uint32_t> ids_;         ///< of bodies, by the index of the module's handle
};

const EnginePlugin kPlugin{
    .name = "rapier",
    .version = "Rapier of @dimforge/rapier3d-simd 0.20.0, single precision, TGS with soft contacts",
    .licence = "Apache-2.0",
    .presets = kPresets,
    .limits = {.continuous = true},
    .make = make_adapter<Rapier>};

}  // namespace

}  // namespace subworld

SUBWORLD_ENGINE_PLUGIN(subworld::kPlugin)
