#pragma once

#include "lab/stability/cases/case.hpp"
#include "model/body.hpp"
#include "physics/engine.hpp"

#include <functional>
#include <memory>
#include <vector>

namespace subworld {

inline constexpr double kG = 9.81;  ///< m/s^2
/// Default friction of each pair of bodies.
inline constexpr double kMu = 0.5;
inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kDegree = kPi / 180.0;

/// Movable bodies of uniform density, for `add`; a mass of 0 fixes them.
[[nodiscard]] Body box_body(const Vec3& size_m, double mass_kg, const Material& material = {});
[[nodiscard]] Body cube_body(double side_m, double mass_kg, const Material& material = {});
[[nodiscard]] Body ball_body(double radius_m, double mass_kg, const Material& material = {});
/// Axis z.
[[nodiscard]] Body cylinder_body(double radius_m, double length_m, double mass_kg, const Material& material = {});
/// The half-space below z = 0 of its frame.
[[nodiscard]] Body plane_body(const Material& material = {});

[[nodiscard]] BodyState placed(const Vec3& position, const Quat& orientation = Quat::Identity());
[[nodiscard]] Quat turned(double angle_rad, const Vec3& axis);

/// A small world in one engine.
class TestBed {
 public:
  explicit TestBed(const EngineSetting& setting, const Vec3& gravity = Vec3(0.0, 0.0, -kG),
                   const std::vector<Mesh>& meshes = {});

  BodyId add(Body body, const BodyState& state);
  BodyId add(const Body& body, const Vec3& position) { return add(body, placed(position)); }
  /// The plane z = 0.
  BodyId add_floor(const Material& material = {}) { return add(plane_body(material), BodyState{}); }
  /// The floor and four planes as walls of a square bin around the z axis.
  void add_bin(double width_m, const Material& material = {});

  /// One step. Throws `Interrupted`, or `std::runtime_error` if a state is not finite.
  void step();
  /// The number of steps that fits best.
  void run(double seconds);
  /// The same, while `goes_on` after each step returns true. Returns whether all steps were made.
  bool run(double seconds, const std::function<bool()>& goes_on);

  [[nodiscard]] Engine& engine() { return *engine_; }
  [[nodiscard]] const Body& body(BodyId id) const { return bodies_[index(id)]; }
  [[nodiscard]] const std::vector<Body>& bodies() const { return bodies_; }
  [[nodiscard]] BodyState state(BodyId id) const { return engine_->state(id); }
  [[nodiscard]] Vec3 position(BodyId id) const { return state(id).position; }
  [[nodiscard]] double dt_s() const { return dt_s_; }
  [[nodiscard]] double time_s() const { return steps_ * dt_s_; }
  /// Kinetic and potential energy of all movable bodies, J. A position is ahead of its velocity by half a sub-step
  /// (Engine::integration_substep_s). The potential energy is computed for the common time, because otherwise it would
  /// change in free fall.
  [[nodiscard]] double energy_j() const;
  /// The largest distance of a movable body from its start, m.
  [[nodiscard]] double moved_m() const;
  /// The largest speed of a movable body, m/s.
  [[nodiscard]] double fastest_m_s() const;

 private:
  Vec3 gravity_;
  double dt_s_;
  std::unique_ptr<Engine> engine_;
  std::vector<Body> bodies_;
  std::vector<BodyState> starts_;
  int steps_ = 0;
};

}  // namespace subworld
