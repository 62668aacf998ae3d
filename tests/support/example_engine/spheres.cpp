// The smallest complete engine: spheres on planes, by sequential impulses. It shows the duties of an adapter; see
// "Adding an engine" in common/physics/README.md.
#include "model/error.hpp"
#include "model/vectors.hpp"
#include "physics/contact_totals.hpp"
#include "physics/plugin.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>
#include <utility>
#include <vector>

namespace subworld {

namespace {

constexpr SubstepCost kCost{.body_s = 0.3e-6, .contact_s = 0.3e-6, .contact_iteration_s = 0.03e-6};
constexpr EnginePreset kPresets[] = {
    {.name = "fast", .what = "10 iterations", .iterations = 10, .cost = kCost},
    {.name = "quality", .what = "100 iterations: for piles", .iterations = 100, .cost = kCost},
};
constexpr double kPushOut = 0.2;  ///< share of a penetration that a step removes, by position only

extern const EnginePlugin kPlugin;

struct Slot {
  Body body;
  Role role = Role::body;
  BodyState state;
  double inverse_mass = 0.0;
  double inverse_inertia = 0.0;
  Vec3 weight = Vec3::Zero();
  Vec3 force = Vec3::Zero();
  Vec3 torque = Vec3::Zero();
};

/// A contact in the solver.
struct Row {
  std::uint32_t a, b;
  Vec3 point, normal;
  double distance, friction, bounce;
  double normal_impulse = 0.0;
  Vec3 tangential_impulse = Vec3::Zero();
};

/// A body in a checkpoint: id and 19 numbers.
struct SavedBody {
  std::uint64_t id;
  std::array<double, 19> numbers;  ///< the state, then force and torque of the next step
};
using Numbers = Eigen::Matrix<double, 19, 1>;

class Spheres final : public Engine {
 public:
  explicit Spheres(const EngineSettings& settings)
      : gravity_(settings.gravity),
        substeps_(settings.substeps.value_or(1)),
        iterations_(settings.iterations.value_or(kPresets[find_preset(kPlugin, settings.preset)].iterations)) {}

  std::string_view name() const noexcept override { return kPlugin.name; }

  Capabilities capabilities() const noexcept override {
    return {.normal_impulse = Fidelity::exact,
            .tangential_impulse = Fidelity::exact,
            .gyroscopic = Fidelity::exact,  // a sphere has no gyroscopic torque
            .checkpoint = Fidelity::exact,  // states and forces are the whole state between steps
            .deterministic = true};
  }

  void add(const Body& body, const BodyState& state, Role role) override {
    const bool known = body.shape.kind == ShapeKind::sphere || (body.shape.kind == ShapeKind::plane && body.fixed());
    if (!known) {
      throw Error(ExitCode::usage, fmt::format("engine spheres has spheres and fixed planes only; body {} is neither: "
                                               "choose another engine for this scene",
                                               index(body.id)));
    }
    if (contains(body.id)) throw Error(ExitCode::failed, fmt::format("body {} is in the engine", index(body.id)));
    if (!finite(state)) throw Error(ExitCode::failed, fmt::format("body {}: state is not finite", index(body.id)));
    if (index(body.id) >= slots_.size()) slots_.resize(index(body.id) + 1);
    Slot& slot = slots_[index(body.id)].emplace();
    slot.body = body;
    slot.role = role;
    slot.state = state;
    if (!body.fixed()) {
      set_inertia(body.id, body.mass, body.inertia);
      if (body.gravity) slot.weight = body.mass * gravity_;
    }
    contacts_.clear();
  }

  void remove(BodyId id) override {
    (void)at(id);
    slots_[index(id)].reset();
    contacts_.clear();
  }

  bool contains(BodyId id) const noexcept override {
    return index(id) < slots_.size() && slots_[index(id)].has_value();
  }

  BodyState state(BodyId id) const override { return at(id).state; }

  bool set_state(BodyId id, const BodyState& state) override {
    if (!finite(state)) return false;
    at(id).state = state;
    return true;
  }

  bool set_velocity(BodyId id, const Vec3& linear, const Vec3& angular) override {
    if (!linear.allFinite() || !angular.allFinite()) return false;
    at(id).state.linear_velocity = linear;
    at(id).state.angular_velocity = angular;
    return true;
  }

  void set_inertia(BodyId id, double mass, const Vec3& inertia) override {
    Slot& slot = at(id);
    slot.inverse_mass = 1.0 / mass;
    slot.inverse_inertia = slot.body.rotates ? 1.0 / inertia.mean() : 0.0;
  }

  bool apply_impulse(BodyId id, const Vec3& impulse, const Vec3& point) override {
    if (!impulse.allFinite() || !point.allFinite()) return false;
    push(at(id), impulse, point);
    return true;
  }

  bool apply_force(BodyId id, const Vec3& force, const Vec3& torque) override {
    if (!force.allFinite() || !torque.allFinite()) return false;
    at(id).force += force;
    at(id).torque += torque;
    return true;
  }

  double integration_substep_s(double dt) const noexcept override { return dt / substeps_; }
  void step(double dt) override {
    contacts_.clear();
    for (int i = 0; i < substeps_; ++i) substep(i, dt / substeps_);
    contacts_.merge();
    for (auto& slot : slots_) {
      if (slot) slot->force = slot->torque = Vec3::Zero();
    }
  }

  std::span<const Contact> contacts() const noexcept override { return contacts_.contacts(); }

  Box bounds(BodyId id) const override {
    const Slot& slot = at(id);
    const double reach = slot.body.shape.kind == ShapeKind::plane ? 1e9 : slot.body.shape.radius;
    return {slot.state.position - Vec3::Constant(reach), slot.state.position + Vec3::Constant(reach)};
  }

  void overlap(const Box& box, std::vector<BodyId>& out) const override {
    out.clear();
    for (const auto& slot : slots_) {
      if (slot && bounds(slot->body.id).meets(box)) out.push_back(slot->body.id);
    }
  }

  Checkpoint checkpoint() const override {
    Checkpoint saved;
    for (const auto& slot : slots_) {
      if (!slot) continue;
      SavedBody entry{index(slot->body.id), {}};
      Eigen::Map<Numbers>(entry.numbers.data()) << slot->state.position, slot->state.orientation.coeffs(),
          slot->state.linear_velocity, slot->state.angular_velocity, slot->force, slot->torque;
      const auto* begin = reinterpret_cast<const std::byte*>(&entry);
      saved.bytes.insert(saved.bytes.end(), begin, begin + sizeof entry);
    }
    return saved;
  }

  void restore(const Checkpoint& saved) override {
    std::vector<SavedBody> entries(saved.bytes.size() / sizeof(SavedBody));
    const auto held = static_cast<std::size_t>(std::ranges::count_if(slots_, [](const auto& s) { return bool(s); }));
    const bool whole = saved.bytes.size() == entries.size() * sizeof(SavedBody) && entries.size() == held;
    if (whole && held > 0) std::memcpy(entries.data(), saved.bytes.data(), saved.bytes.size());
    const auto known = [this](const SavedBody& e) { return contains(BodyId{static_cast<std::uint32_t>(e.id)}); };
    if (!whole || !std::ranges::all_of(entries, known)) {
      throw Error(ExitCode::failed,
                  "the checkpoint is of another engine or of other bodies; take one from this engine");
    }
    for (const SavedBody& entry : entries) {
      Slot& slot = at(BodyId{static_cast<std::uint32_t>(entry.id)});
      const Eigen::Map<const Numbers> x(entry.numbers.data());
      slot.state = {x.segment<3>(0), Quat(x[6], x[3], x[4], x[5]), x.segment<3>(7), x.segment<3>(10)};
      slot.force = x.segment<3>(13);
      slot.torque = x.segment<3>(16);
    }
    contacts_.clear();
  }

 private:
  const Slot& at(BodyId id) const {
    if (!contains(id)) throw Error(ExitCode::failed, fmt::format("body {} is not in the engine", index(id)));
    return *slots_[index(id)];
  }
  Slot& at(BodyId id) { return const_cast<Slot&>(std::as_const(*this).at(id)); }

  static void push(Slot& slot, const Vec3& impulse, const Vec3& point) {
    slot.state.linear_velocity += slot.inverse_mass * impulse;
    slot.state.angular_velocity += slot.inverse_inertia * (point - slot.state.position).cross(impulse);
  }

  static Vec3 velocity_at(const Slot& slot, const Vec3& point) {
    return slot.state.linear_velocity + slot.state.angular_velocity.cross(point - slot.state.position);
  }

  void substep(int number, double dt) {
    for (auto& slot : slots_) {
      if (!slot || slot->body.fixed()) continue;
      slot->state.linear_velocity += dt * slot->inverse_mass * (slot->weight + slot->force);
      slot->state.angular_velocity += dt * slot->inverse_inertia * slot->torque;
    }
    find_contacts(dt);
    for (int i = 0; i < iterations_; ++i) {
      for (Row& row : rows_) solve(row, dt);
    }
    for (auto& slot : slots_) {
      if (!slot || slot->body.fixed()) continue;
      slot->state.position += dt * slot->state.linear_velocity;
      slot->state.orientation = rotated(slot->state.orientation, slot->state.angular_velocity, dt);
    }
    for (const Row& row : rows_) report(row, number);
  }

  void find_contacts(double dt) {
    rows_.clear();
    for (std::uint32_t a = 0; a < slots_.size(); ++a) {
      for (std::uint32_t b = a + 1; b < slots_.size(); ++b) {
        if (slots_[a] && slots_[b]) find_contact(a, b, dt);
      }
    }
  }

  void find_contact(std::uint32_t a, std::uint32_t b, double dt) {
    const Slot& first = *slots_[a];
    const Slot& second = *slots_[b];
    const bool ghosts_meet_only_movable = (first.role != Role::body && second.body.fixed()) ||
                                          (second.role != Role::body && first.body.fixed()) ||
                                          (first.role == Role::ghost && second.role == Role::ghost);
    if ((first.body.fixed() && second.body.fixed()) || ghosts_meet_only_movable) return;
    Row row{.a = a, .b = b, .point = {}, .normal = {}, .distance = 0.0, .friction = 0.0, .bounce = 0.0};
    const double radius_b = second.body.shape.radius;
    if (second.body.shape.kind == ShapeKind::plane || first.body.shape.kind == ShapeKind::plane) {
      const bool plane_second = second.body.shape.kind == ShapeKind::plane;
      const Slot& plane = plane_second ? second : first;
      const Slot& sphere = plane_second ? first : second;
      const Vec3 up = plane.state.orientation * Vec3::UnitZ();
      const double height = up.dot(sphere.state.position - plane.state.position);
      row.normal = plane_second ? up : Vec3(-up);
      row.distance = height - sphere.body.shape.radius;
      row.point = plane_second ? Vec3(sphere.state.position - height * up)
                               : Vec3(sphere.state.position - sphere.body.shape.radius * up);
    } else {
      const Vec3 apart = first.state.position - second.state.position;
      const double length = apart.norm();
      row.normal = length > 0.0 ? Vec3(apart / length) : Vec3::UnitZ();
      row.distance = length - first.body.shape.radius - radius_b;
      row.point = second.state.position + radius_b * row.normal;
    }
    const double closing = -row.normal.dot(velocity_at(first, row.point) - velocity_at(second, row.point));
    if (row.distance > std::max(0.0, closing) * dt) return;  // will not touch within this step
    row.friction = std::sqrt(first.body.material.friction * second.body.material.friction);
    row.bounce = first.body.material.restitution * second.body.material.restitution * std::max(0.0, closing);
    if (row.bounce < 2.0 * gravity_.norm() * dt) row.bounce = 0.0;  // otherwise a resting body would hop
    rows_.push_back(row);
  }

  /// One projected Gauss-Seidel update of a contact: the normal impulse only pushes, friction stays in its cone.
  void solve(Row& row, double dt) {
    Slot& a = *slots_[row.a];
    Slot& b = *slots_[row.b];
    const auto mobility = [&](const Vec3& d) {
      return a.inverse_mass + b.inverse_mass +
             a.inverse_inertia * (row.point - a.state.position).cross(d).squaredNorm() +
             b.inverse_inertia * (row.point - b.state.position).cross(d).squaredNorm();
    };
    const auto give = [&](const Vec3& impulse) {
      push(a, impulse, row.point);
      push(b, -impulse, row.point);
    };
    const Vec3 relative = velocity_at(a, row.point) - velocity_at(b, row.point);
    // A gap may close within the step, not faster. A share of a penetration is removed.
    const double wanted = row.distance > 0.0 ? -row.distance / dt : -kPushOut * row.distance / dt;
    const double normal = std::max(
        0.0, row.normal_impulse + (std::max(row.bounce, wanted) - row.normal.dot(relative)) / mobility(row.normal));
    give((normal - row.normal_impulse) * row.normal);
    row.normal_impulse = normal;

    const Vec3 after = velocity_at(a, row.point) - velocity_at(b, row.point);
    const Vec3 sliding = after - row.normal.dot(after) * row.normal;
    const double speed = sliding.norm();
    if (speed < 1e-12) return;
    const Vec3 tangential =
        shortened(row.tangential_impulse - sliding / mobility(sliding / speed), row.friction * row.normal_impulse);
    give(tangential - row.tangential_impulse);
    row.tangential_impulse = tangential;
  }

  void report(const Row& row, int substep) {
    Contact contact;
    contact.a = BodyId{row.a};
    contact.b = BodyId{row.b};
    contact.point = row.point;
    contact.normal = row.normal;
    contact.distance = row.distance;
    contact.normal_impulse = row.normal_impulse;
    contact.tangential_impulse = row.tangential_impulse;
    contacts_.add(contact, substep, 1e9);  // two bodies have one point, which is identified at any place
  }

  Vec3 gravity_;
  int substeps_;
  int iterations_;
  std::vector<std::optional<Slot>> slots_;  ///< by id
  std::vector<Row> rows_;
  ContactTotals contacts_;
};

const EnginePlugin kPlugin{
    .name = "spheres",
    .version = "an example",
    .licence = "Apache-2.0",
    .presets = kPresets,
    .make = [](const EngineSettings& settings, std::span<const Mesh>) -> std::unique_ptr<Engine> {
      return std::make_unique<Spheres>(settings);
    }};

}  // namespace

}  // namespace subworld

SUBWORLD_ENGINE_PLUGIN(subworld::kPlugin)
