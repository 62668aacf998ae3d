// The smallest complete engine: spheres on planes, by sequential impulses. It shows the duties of an adapter; see
// "Adding an engine" in common/physics/README.md.
#include "model/error.hpp"
#include "model/vectors.hpp"
#include "physics/adapter.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
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

struct Slot : AdapterSlot {
  Shape shape;
  CollisionClass collides{};
  BodyState state;
  double inverse_mass = 0.0;
  double inverse_inertia = 0.0;
};

/// A contact in the solver.
struct Row {
  std::uint32_t a, b;
  Vec3 point, normal;
  double distance, friction, bounce;
  double normal_impulse = 0.0;
  Vec3 tangential_impulse = Vec3::Zero();
};

class Spheres final : public Adapter<Slot> {
 public:
  explicit Spheres(const EngineSettings& settings, std::span<const Mesh>)
      : Adapter(kPlugin, settings),
        gravity_m_s2_(settings.gravity.norm()),
        iterations_(settings.iterations.value_or(preset_.iterations)) {}

  Capabilities capabilities() const noexcept override {
    return {.normal_impulse = Fidelity::exact,
            .tangential_impulse = Fidelity::exact,
            .gyroscopic = Fidelity::exact,  // a sphere has no gyroscopic torque
            .checkpoint = Fidelity::exact,  // states and forces are the whole state between steps
            .deterministic = true};
  }

  BodyState state(BodyId id) const override { return at(id).state; }

  void step(double dt) override {
    step_in_parts(dt, [this](double h, int number) { substep(number, h); });
  }

  Box bounds(BodyId id) const override {
    const Slot& slot = at(id);
    const double reach = slot.shape_kind == ShapeKind::plane ? kEverywhere : slot.shape.radius;
    return {slot.state.position - Vec3::Constant(reach), slot.state.position + Vec3::Constant(reach)};
  }

 private:
  void create(Slot& slot, const Body& body, const BodyState& state, const CollisionClass& collides) override {
    const bool known = body.shape.kind == ShapeKind::sphere || (body.shape.kind == ShapeKind::plane && body.fixed());
    if (!known) {
      throw Error(ExitCode::usage, fmt::format("engine spheres has spheres and fixed planes only; body {} is neither: "
                                               "choose another engine for this scene",
                                               slot.id));
    }
    slot.shape = body.shape;
    slot.collides = collides;
    slot.state = state;
    if (!slot.fixed) put_inertia(slot);
  }
  void destroy(Slot&) override {}
  void place(Slot& slot, const BodyState& state) override { slot.state = state; }
  void put_velocity(Slot& slot, const Vec3& linear, const Vec3& angular) override {
    slot.state.linear_velocity = linear;
    slot.state.angular_velocity = angular;
  }
  void put_inertia(Slot& slot) override {
    slot.inverse_mass = 1.0 / slot.mass;
    slot.inverse_inertia = slot.rotates ? 1.0 / slot.inertia.mean() : 0.0;
  }
  void push(Slot& slot, const Vec3& impulse, const Vec3& point) override {
    slot.state.linear_velocity += slot.inverse_mass * impulse;
    slot.state.angular_velocity += slot.inverse_inertia * (point - slot.state.position).cross(impulse);
  }

  static Vec3 velocity_at(const Slot& slot, const Vec3& point) {
    return slot.state.linear_velocity + slot.state.angular_velocity.cross(point - slot.state.position);
  }

  void substep(int number, double dt) {
    for (const std::uint32_t id : movable_) {
      Slot& slot = slots_[id];
      slot.state.linear_velocity += dt * slot.inverse_mass * (slot.weight + slot.force);
      slot.state.angular_velocity += dt * slot.inverse_inertia * slot.torque;
    }
    find_contacts(dt);
    for (int i = 0; i < iterations_; ++i) {
      for (Row& row : rows_) solve(row, dt);
    }
    for (const std::uint32_t id : movable_) {
      BodyState& state = slots_[id].state;
      state.position += dt * state.linear_velocity;
      state.orientation = rotated(state.orientation, state.angular_velocity, dt);
    }
    for (const Row& row : rows_) report(row, number);
  }

  void find_contacts(double dt) {
    rows_.clear();
    for (std::uint32_t a = 0; a < slots_.size(); ++a) {
      for (std::uint32_t b = a + 1; b < slots_.size(); ++b) {
        if (slots_[a].used && slots_[b].used) find_contact(a, b, dt);
      }
    }
  }

  void find_contact(std::uint32_t a, std::uint32_t b, double dt) {
    const Slot& first = slots_[a];
    const Slot& second = slots_[b];
    if ((first.collides.member & second.collides.meets) == 0 || (second.collides.member & first.collides.meets) == 0) {
      return;
    }
    Row row{.a = a, .b = b, .point = {}, .normal = {}, .distance = 0.0, .friction = 0.0, .bounce = 0.0};
    const double radius_b = second.shape.radius;
    if (second.shape.kind == ShapeKind::plane || first.shape.kind == ShapeKind::plane) {
      const bool plane_second = second.shape.kind == ShapeKind::plane;
      const Slot& plane = plane_second ? second : first;
      const Slot& sphere = plane_second ? first : second;
      const Vec3 up = plane.state.orientation * Vec3::UnitZ();
      const double height = up.dot(sphere.state.position - plane.state.position);
      row.normal = plane_second ? up : Vec3(-up);
      row.distance = height - sphere.shape.radius;
      row.point = plane_second ? Vec3(sphere.state.position - height * up)
                               : Vec3(sphere.state.position - sphere.shape.radius * up);
    } else {
      const Vec3 apart = first.state.position - second.state.position;
      const double length = apart.norm();
      row.normal = length > 0.0 ? Vec3(apart / length) : Vec3::UnitZ();
      row.distance = length - first.shape.radius - radius_b;
      row.point = second.state.position + radius_b * row.normal;
    }
    const double closing = -row.normal.dot(velocity_at(first, row.point) - velocity_at(second, row.point));
    if (row.distance > std::max(0.0, closing) * dt) return;  // will not touch within this step
    row.friction = std::sqrt(first.material.friction * second.material.friction);
    row.bounce = first.material.restitution * second.material.restitution * std::max(0.0, closing);
    if (row.bounce < 2.0 * gravity_m_s2_ * dt) row.bounce = 0.0;  // otherwise a resting body would hop
    rows_.push_back(row);
  }

  /// One projected Gauss-Seidel update of a contact: the normal impulse only pushes, friction stays in its cone.
  void solve(Row& row, double dt) {
    Slot& a = slots_[row.a];
    Slot& b = slots_[row.b];
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

  double gravity_m_s2_;
  int iterations_;
  std::vector<Row> rows_;
};

const EnginePlugin kPlugin{.name = "spheres",
                           .version = "an example",
                           .licence = "Apache-2.0",
                           .presets = kPresets,
                           .make = make_adapter<Spheres>};

}  // namespace

}  // namespace subworld

SUBWORLD_ENGINE_PLUGIN(subworld::kPlugin)
