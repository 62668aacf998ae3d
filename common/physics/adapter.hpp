#pragma once

#include "physics/contact_totals.hpp"
#include "physics/plugin.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace subworld {

/// Which bodies collide: a pair does if the `meets` of each has the other's `member`.
struct CollisionClass {
  std::uint32_t member, meets;
};
[[nodiscard]] CollisionClass collision_class(Role role, bool fixed) noexcept;

/// The mesh of a shape. Throws `Error` (usage) if its index is out of range.
[[nodiscard]] const Mesh& mesh_of(const Shape& shape, std::span<const Mesh> meshes);

/// What every adapter holds of a body.
struct AdapterSlot {
  AdapterSlot() = default;
  AdapterSlot(const Body& body, const Vec3& gravity);

  std::uint32_t id = 0;
  bool used = false;  ///< false: no body of this id
  bool fixed = false;
  bool rotates = true;
  bool ghost = false;
  std::uint32_t group = 0;
  ShapeKind shape_kind = ShapeKind::sphere;
  Material material;
  Vec3 surface_velocity = Vec3::Zero(), surface_turn = Vec3::Zero();  ///< m/s, rad/s
  double mass = 0.0;                                                  ///< kg
  Vec3 inertia = Vec3::Zero();                                        ///< kg m^2
  Vec3 weight = Vec3::Zero();                                         ///< N
  Vec3 force = Vec3::Zero();                                          ///< for the next step, N
  Vec3 torque = Vec3::Zero();                                         ///< N m
};

/// A body in a checkpoint.
struct SavedBody {
  std::uint64_t id;
  std::array<double, 13> state;
  std::array<double, 10> load;  ///< mass, inertia, force and torque of the next step; mass 0: fixed
};

void append(const void* from, std::size_t size, std::vector<std::byte>& to);
[[nodiscard]] SavedBody saved(const AdapterSlot& slot, const BodyState& state);
/// Writes the load to the slot and returns the state.
BodyState restored(const SavedBody& saved, AdapterSlot& slot);
/// Begins a checkpoint of this engine.
void save_bodies(std::string_view engine, std::span<const SavedBody> bodies, std::vector<std::byte>& to);
/// Reads the bodies and removes them from the front of `saved`. Throws `Error` if another engine has written them.
[[nodiscard]] std::vector<SavedBody> read_bodies(std::string_view engine, std::span<const std::byte>& saved);
/// Throws the error for a checkpoint that does not fit.
[[noreturn]] void refuse_checkpoint();

[[noreturn]] void refuse_body(BodyId id, const char* why);
/// `why`: what the engine lacks for it, and the engines that have it.
[[noreturn]] void refuse_body(std::string_view engine, const Body& body, std::string_view why);
[[noreturn]] void refuse_joints(std::string_view engine);
/// Throws if the body or a pair has rolling or spinning friction.
void refuse_turning_friction(std::string_view engine, const Body& body, std::span<const MaterialPair> pairs);
[[noreturn]] void refuse_pairs(std::string_view engine);

inline constexpr double kEverywhere = 1e18;  ///< reach of a plane's bounds, in units of length

/// Common part of the adapters: bodies by id, their loads, sub-steps, checkpoints, and the checks of the interface.
/// `Slot` is derived from AdapterSlot. A derived class makes, moves and reads the engine's bodies.
template <class Slot>
class Adapter : public Engine {
 public:
  std::string_view name() const noexcept final { return plugin_.name; }

  void set_joints(std::span<const Joint> joints) final {
    for (const Joint& joint : joints) require(joint);
    joints_.assign(joints.begin(), joints.end());
    loads_.assign(joints.size(), {});
    joined_.assign(joints.size(), false);
    broken_.assign(joints.size(), false);
    for (std::size_t j = 0; j < joints.size(); ++j) {
      for (const BodyId id : {joints[j].a, joints[j].b}) {
        if (index(id) >= joints_of_.size()) joints_of_.resize(index(id) + std::size_t{1});
        joints_of_[index(id)].push_back(j);
      }
    }
  }
  void break_joint(std::size_t joint) final {
    if (joined_.at(joint)) separate(joint);
    broken_[joint] = true;
  }
  std::span<const JointLoad> joint_loads() const noexcept final { return loads_; }

  void add(const Body& body, const BodyState& state, Role role) final {
    if (contains(body.id)) refuse_body(body.id, "is in the engine already");
    if (!finite(state)) refuse_body(body.id, "has a state that is not finite");
    Slot slot;
    static_cast<AdapterSlot&>(slot) = AdapterSlot(body, gravity_);
    create(slot, body, state, collision_class(role, body.fixed()));
    put_velocity(slot, state.linear_velocity, state.angular_velocity);
    if (slot.id >= slots_.size()) slots_.resize(slot.id + std::size_t{1});
    if (!slot.fixed) movable_.push_back(slot.id);
    slots_[slot.id] = std::move(slot);
    slots_[index(body.id)].ghost = role != Role::body;
    for (const std::size_t j : joints_of(body.id)) {
      const bool there = contains(joints_[j].a) && contains(joints_[j].b);
      if (there && !broken_[j] && !at(joints_[j].a).ghost && !at(joints_[j].b).ghost) join(j);
    }
    contacts_.clear();
  }
  void remove(BodyId id) final {
    (void)at(id);
    for (const std::size_t j : joints_of(id)) {
      if (joined_[j]) separate(j);
    }
    destroy(at(id));
    at(id) = {};
    std::erase(movable_, index(id));
    contacts_.clear();
  }
  void remove_all(std::span<const BodyId> ids) final {
    if (ids.size() > 1) part(ids);
    for (const BodyId id : ids) remove(id);
  }
  bool contains(BodyId id) const noexcept final { return index(id) < slots_.size() && slots_[index(id)].used; }

  bool set_state(BodyId id, const BodyState& state) final {
    if (!finite(state)) return false;
    place(at(id), state);
    return true;
  }
  bool set_velocity(BodyId id, const Vec3& linear, const Vec3& angular) final {
    if (!linear.allFinite() || !angular.allFinite()) return false;
    put_velocity(at(id), linear, angular);
    return true;
  }
  void set_inertia(BodyId id, double mass, const Vec3& inertia) final {
    Slot& slot = at(id);
    if (slot.fixed) return;
    slot.mass = mass;
    slot.inertia = inertia;
    put_inertia(slot);
  }
  bool apply_impulse(BodyId id, const Vec3& impulse, const Vec3& point) final {
    if (!impulse.allFinite() || !point.allFinite()) return false;
    if (Slot& slot = at(id); !slot.fixed) push(slot, impulse, point);
    return true;
  }
  bool apply_force(BodyId id, const Vec3& force, const Vec3& torque) final {
    if (!force.allFinite() || !torque.allFinite()) return false;
    Slot& slot = at(id);
    slot.force += force;
    slot.torque += torque;
    return true;
  }

  double integration_substep_s(double dt) const noexcept override { return dt / substeps(dt); }
  std::span<const Contact> contacts() const noexcept final { return contacts_.contacts(); }
  void overlap(const Box& box, std::vector<BodyId>& out) const override {
    out.clear();
    for (const Slot& slot : slots_) {
      if (slot.used && bounds(BodyId{slot.id}).meets(box)) out.push_back(BodyId{slot.id});
    }
  }

  Checkpoint checkpoint() const final {
    // The order of adding may be the engine's order of solving, so it is part of the state.
    std::vector<std::uint32_t> ids = movable_;
    for (const Slot& slot : slots_) {
      if (slot.used && slot.fixed) ids.push_back(slot.id);
    }
    std::vector<SavedBody> bodies;
    for (const std::uint32_t id : ids) bodies.push_back(saved(slots_[id], state(BodyId{id})));
    Checkpoint checkpoint;
    save_bodies(name(), bodies, checkpoint.bytes);
    save_rest(bodies, checkpoint.bytes);
    return checkpoint;
  }
  void restore(const Checkpoint& checkpoint) final {
    std::span<const std::byte> rest = checkpoint.bytes;
    const std::vector<SavedBody> bodies = read_bodies(name(), rest);
    std::size_t held = 0;
    for (const Slot& slot : slots_) held += slot.used;
    if (bodies.size() != held) refuse_checkpoint();
    std::vector<std::uint32_t> order;
    for (const SavedBody& entry : bodies) {
      const auto id = static_cast<std::uint32_t>(entry.id);
      if (!contains(BodyId{id}) || slots_[id].fixed != (entry.load[0] == 0.0)) refuse_checkpoint();
      if (!slots_[id].fixed) order.push_back(id);
    }
    restore_rest(bodies, rest);
    if (order != movable_) reorder(order);
    movable_ = order;
    for (const SavedBody& entry : bodies) {
      Slot& slot = slots_[entry.id];
      restore_body(slot, restored(entry, slot));
    }
    contacts_.clear();
  }

 protected:
  Adapter(const EnginePlugin& plugin, const EngineSettings& settings)
      : plugin_(plugin),
        preset_(plugin.presets[find_preset(plugin, settings.preset)]),
        gravity_(settings.gravity),
        fixed_substeps_(settings.substeps),
        longest_substep_s_(settings.longest_substep_s.value_or(preset_.longest_substep_s)) {}

  /// Makes the body in the engine, in its state. If it throws, nothing is added.
  virtual void create(Slot& slot, const Body& body, const BodyState& state, const CollisionClass& collides) = 0;
  virtual void destroy(Slot& slot) = 0;
  /// Called before several bodies are removed.
  virtual void part(std::span<const BodyId>) {}
  virtual void place(Slot& slot, const BodyState& state) = 0;
  virtual void put_velocity(Slot& slot, const Vec3& linear, const Vec3& angular) = 0;
  /// This and the next function: for movable bodies only.
  virtual void put_inertia(Slot& slot) = 0;
  virtual void push(Slot& slot, const Vec3& impulse, const Vec3& point) = 0;

  /// Throws `Error` (usage) for a joint that the engine does not have.
  virtual void require(const Joint& /*joint*/) const { refuse_joints(name()); }
  /// Makes a joint between bodies that are there, and removes it.
  virtual void connect(std::size_t /*joint*/) {}
  virtual void disconnect(std::size_t /*joint*/) {}
  /// What the joint did in the sub-step that has just ended.
  virtual JointLoad take_load(std::size_t /*joint*/) { return {}; }
  /// Of a joint that acts, at its place now.
  [[nodiscard]] Contact contact_of(std::size_t joint) const;

  /// What a checkpoint has beside the bodies.
  virtual void save_rest(std::span<const SavedBody>, std::vector<std::byte>&) const {}
  /// Called before any body is restored. Throws `Error` if the rest does not fit.
  virtual void restore_rest(std::span<const SavedBody>, std::span<const std::byte> rest) {
    if (!rest.empty()) refuse_checkpoint();
  }
  /// The order of adding the movable bodies is another one.
  virtual void reorder(std::span<const std::uint32_t> /*ids*/) {}
  virtual void restore_body(Slot& slot, const BodyState& state) {
    if (!slot.fixed) put_inertia(slot);
    place(slot, state);
  }

  [[nodiscard]] Slot& at(BodyId id) { return const_cast<Slot&>(std::as_const(*this).at(id)); }
  [[nodiscard]] const Slot& at(BodyId id) const {
    if (!contains(id)) refuse_body(id, "is not in the engine");
    return slots_[index(id)];
  }
  [[nodiscard]] int substeps(double dt) const noexcept {
    return substep_count(dt, fixed_substeps_, longest_substep_s_);
  }

  /// Calls `substep(h, number)` for each sub-step of h (s) of a step of dt (s), at least `least`, ends the loads, and
  /// totals the contacts.
  template <class Substep>
  void step_in_parts(double dt, const Substep& substep, int least = 1) {
    const int count = std::max(substeps(dt), least);
    contacts_.clear();
    clock_.start();
    loads_.assign(joints_.size(), {});
    for (int i = 0; i < count; ++i) {
      substep(dt / count, i);
      for (std::size_t j = 0; j < joints_.size(); ++j) {
        if (joined_[j]) loads_[j] += take_load(j);
      }
    }
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      if (joined_[j]) contacts_.add(contact_of(j), count, 0.0);
    }
    for (const std::uint32_t id : movable_) slots_[id].force = slots_[id].torque = Vec3::Zero();
    contacts_.merge();
    clock_.ends(&EngineTimes::totals_s);
  }

  const EnginePlugin& plugin_;
  const EnginePreset& preset_;
  std::vector<Slot> slots_;             ///< by id
  std::vector<std::uint32_t> movable_;  ///< ids, in the order of adding
  ContactTotals contacts_;
  std::vector<Joint> joints_;

 private:
  [[nodiscard]] std::span<const std::size_t> joints_of(BodyId id) const noexcept {
    if (index(id) >= joints_of_.size()) return {};
    return joints_of_[index(id)];
  }
  void join(std::size_t joint) {
    connect(joint);
    joined_[joint] = true;
  }
  void separate(std::size_t joint) {
    disconnect(joint);
    joined_[joint] = false;
  }

  std::vector<std::vector<std::size_t>> joints_of_;  ///< by body
  std::vector<bool> joined_, broken_;                ///< by joint
  std::vector<JointLoad> loads_;
  Vec3 gravity_;
  std::optional<int> fixed_substeps_;
  double longest_substep_s_;
};

/// For `EnginePlugin::make`.
template <class Engine_>
std::unique_ptr<Engine> make_adapter(const EngineSettings& settings, std::span<const Mesh> meshes) {
  return std::make_unique<Engine_>(settings, meshes);
}

template <class Slot>
Contact Adapter<Slot>::contact_of(std::size_t j) const {
  const Joint& joint = joints_[j];
  const BodyState at = state(joint.a);
  Contact contact{.a = joint.a, .b = joint.b, .normal = Vec3::Zero(), .tangential_impulse = loads_[j].impulse};
  contact.point = (Pose{at.position, at.orientation} * joint.in_a).position;
  if (index(contact.a) > index(contact.b)) {
    std::swap(contact.a, contact.b);
    contact.tangential_impulse *= -1.0;
  }
  return contact;
}

}  // namespace subworld
