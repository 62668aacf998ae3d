#include "lab/stability/bed.hpp"

#include "model/shapes/mass_properties.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace subworld {

namespace {

Body solid(const Shape& shape, double mass_kg, const Material& material) {
  Body body;
  body.shape = shape;
  body.material = material;
  body.mass = mass_kg;
  if (mass_kg > 0.0) body.inertia = principal_inertia(shape, mass_kg);
  return body;
}

EngineSettings bed_settings(const EngineSetting& setting, const Vec3& gravity) {
  EngineSettings settings;
  settings.name = setting.engine;
  settings.preset = setting.preset;
  settings.gravity = gravity;
  return settings;
}

}  // namespace

Body box_body(const Vec3& size_m, double mass_kg, const Material& material) {
  return solid({.kind = ShapeKind::box, .half_extents = 0.5 * size_m}, mass_kg, material);
}

Body cube_body(double side_m, double mass_kg, const Material& material) {
  return box_body(Vec3::Constant(side_m), mass_kg, material);
}

Body ball_body(double radius_m, double mass_kg, const Material& material) {
  return solid({.kind = ShapeKind::sphere, .radius = radius_m}, mass_kg, material);
}

Body cylinder_body(double radius_m, double length_m, double mass_kg, const Material& material) {
  return solid({.kind = ShapeKind::cylinder, .radius = radius_m, .half_length = 0.5 * length_m}, mass_kg, material);
}

Body plane_body(const Material& material) { return solid({.kind = ShapeKind::plane}, 0.0, material); }

BodyState placed(const Vec3& position, const Quat& orientation) {
  BodyState state;
  state.position = position;
  state.orientation = orientation;
  return state;
}

Quat turned(double angle_rad, const Vec3& axis) { return Quat(Eigen::AngleAxisd(angle_rad, axis)); }

TestBed::TestBed(const EngineSetting& setting, const Vec3& gravity, const std::vector<Mesh>& meshes)
    : gravity_(gravity), dt_s_(setting.dt_s), engine_(make_engine(bed_settings(setting, gravity), meshes)) {}

BodyId TestBed::add(Body body, const BodyState& state) {
  body.id = BodyId{static_cast<std::uint32_t>(bodies_.size())};
  body.name = fmt::format("body{}", bodies_.size());
  engine_->add(body, state);
  bodies_.push_back(body);
  starts_.push_back(state);
  return body.id;
}

void TestBed::add_bin(double width_m, const Material& material) {
  add_floor(material);
  for (int side = 0; side < 4; ++side) {
    const Quat around = turned(0.5 * kPi * side, Vec3::UnitZ());
    add(plane_body(material),
        placed(around * Vec3(-0.5 * width_m, 0.0, 0.0), around * turned(0.5 * kPi, Vec3::UnitY())));
  }
}

void TestBed::step() {
  if (stop_signal() != 0) throw Interrupted{};
  engine_->step(dt_s_);
  ++steps_;
  for (const Body& body : bodies_) {
    if (!body.fixed() && !finite(engine_->state(body.id)))
      throw std::runtime_error(fmt::format("a state is not finite at {:.3g} s", time_s()));
  }
}

void TestBed::run(double seconds) {
  run(seconds, [] { return true; });
}

bool TestBed::run(double seconds, const std::function<bool()>& goes_on) {
  const auto steps = std::max(1L, std::lround(seconds / dt_s_));
  for (long i = 0; i < steps; ++i) {
    step();
    if (!goes_on()) return false;
  }
  return true;
}

double TestBed::energy_j() const {
  const double ahead_s = 0.5 * engine_->integration_substep_s(dt_s_);
  double sum_j = 0.0;
  for (const Body& body : bodies_) {
    if (body.fixed()) continue;
    const BodyState s = engine_->state(body.id);
    sum_j += kinetic_energy(body, s);
    if (body.gravity) sum_j -= body.mass * gravity_.dot(s.position - ahead_s * s.linear_velocity);
  }
  return sum_j;
}

double TestBed::moved_m() const {
  double most_m = 0.0;
  for (const Body& body : bodies_) {
    if (!body.fixed())
      most_m = std::max(most_m, (engine_->state(body.id).position - starts_[index(body.id)].position).norm());
  }
  return most_m;
}

double TestBed::fastest_m_s() const {
  double most_m_s = 0.0;
  for (const Body& body : bodies_) {
    if (!body.fixed()) most_m_s = std::max(most_m_s, engine_->state(body.id).linear_velocity.norm());
  }
  return most_m_s;
}

}  // namespace subworld
