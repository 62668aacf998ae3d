// Rotating bodies: in free space, on a floor, and as a top.

#include "lab/stability/bed.hpp"
#include "lab/stability/cases/cases.hpp"
#include "lab/stability/formulas.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

/// A brick of unequal sides; its middle moment of inertia is that about y.
const Vec3 kBrick_m(0.05, 0.12, 0.2);
constexpr double kFreeFor_s = 10.0;
constexpr double kPoseFor_s = 2.0;
constexpr double kOffAxis = 0.01;  ///< relative to the rate, about the other two axes

/// A brick in space that spins almost about its middle axis.
struct Tumbling {
  Tumbling(const EngineSetting& setting, double rate_rad_s) : bed(setting, Vec3::Zero()) {
    brick = bed.add(box_body(kBrick_m, 1.0), Vec3::Zero());
    start.rate_rad_s = rate_rad_s * Vec3(kOffAxis, 1.0, kOffAxis);
    bed.engine().set_velocity(brick, Vec3::Zero(), start.rate_rad_s);
  }
  [[nodiscard]] Vec3 inertia() const { return bed.body(brick).inertia; }
  [[nodiscard]] Vec3 body_rate() const {
    const BodyState now = bed.state(brick);
    return now.orientation.conjugate() * now.angular_velocity;
  }
  /// From the poses before and after a step only, because engines define the time of a velocity within the step
  /// differently.
  [[nodiscard]] Vec3 momentum_between(const Quat& before, const Quat& after) const {
    const Eigen::AngleAxisd turn(after * before.conjugate());
    const double angle = turn.angle() > kPi ? turn.angle() - 2.0 * kPi : turn.angle();
    const Vec3 rate = angle / bed.dt_s() * turn.axis();
    const Quat middle = before.slerp(0.5, after);
    return middle * inertia().cwiseProduct(middle.conjugate() * rate);
  }
  [[nodiscard]] double energy_j() const { return 0.5 * body_rate().dot(inertia().cwiseProduct(body_rate())); }

  TestBed bed;
  BodyId brick{};
  FreeBody start;
};

Measurement free_energy(const EngineSetting& setting, double rate_rad_s) {
  Tumbling tumbling(setting, rate_rad_s);
  const double start_j = tumbling.energy_j();
  double most_j = 0.0;
  tumbling.bed.run(kFreeFor_s, [&] {
    most_j = std::max(most_j, std::abs(tumbling.energy_j() - start_j));
    return most_j < 1e3 * start_j;
  });
  return {1e2 * most_j / start_j};
}

Measurement free_momentum(const EngineSetting& setting, double rate_rad_s) {
  Tumbling tumbling(setting, rate_rad_s);
  const Vec3 start = tumbling.inertia().cwiseProduct(tumbling.start.rate_rad_s);
  Quat before = tumbling.start.orientation;
  double most = 0.0;
  tumbling.bed.run(kFreeFor_s, [&] {
    const Quat after = tumbling.bed.state(tumbling.brick).orientation;
    most = std::max(most, (tumbling.momentum_between(before, after) - start).norm());
    before = after;
    return true;
  });
  return {1e2 * most / start.norm()};
}

/// Angle between the brick and the solution of Euler's equations.
Measurement free_pose(const EngineSetting& setting, double rate_rad_s) {
  Tumbling tumbling(setting, rate_rad_s);
  tumbling.bed.run(kPoseFor_s);
  const FreeBody exact = turned_by_euler(tumbling.inertia(), tumbling.start, tumbling.bed.time_s());
  return {exact.orientation.angularDistance(tumbling.bed.state(tumbling.brick).orientation) / kDegree};
}

/// Mean period, from the times at which the rate about the middle axis changes its sign; 0 if it does not turn over.
Measurement flip_period(const EngineSetting& setting, double rate_rad_s) {
  Tumbling tumbling(setting, rate_rad_s);
  double before = tumbling.body_rate().y(), first_s = 0.0, last_s = 0.0;
  int crossings = 0;
  tumbling.bed.run(2.0 * kFreeFor_s, [&] {
    const double now = tumbling.body_rate().y();
    if (before * now < 0.0) {
      last_s = tumbling.bed.time_s() - tumbling.bed.dt_s() * now / (now - before);
      if (crossings++ == 0) first_s = last_s;
    }
    before = now;
    return true;
  });
  return {crossings < 2 ? 0.0 : 2.0 * (last_s - first_s) / (crossings - 1)};
}

double flip_period_s(double rate_rad_s) {
  return tumble_period_s(box_body(kBrick_m, 1.0).inertia, rate_rad_s * Vec3(kOffAxis, 1.0, kOffAxis));
}

/// A cone that stands on its tip.
struct Top {
  static constexpr double kRadius_m = 0.06, kHeight_m = 0.04, kMass_kg = 0.2, kTilt_deg = 20.0;
  static constexpr double kCentre_m = 0.75 * kHeight_m;  ///< of mass, from the tip
  double i3 = 0.3 * kMass_kg * kRadius_m * kRadius_m;
  double i_centre = kMass_kg * (0.15 * kRadius_m * kRadius_m + 0.0375 * kHeight_m * kHeight_m);

  /// Of the steady precession.
  [[nodiscard]] double precession(double w3_rad_s) const {
    return precession_rad_s(kMass_kg * kG * kCentre_m, i_centre + kMass_kg * kCentre_m * kCentre_m, i3, w3_rad_s,
                            kTilt_deg * kDegree);
  }
  [[nodiscard]] static Mesh mesh() {
    constexpr int kSides = 32;
    Mesh cone;
    cone.file = "cone";
    cone.vertices = {Vec3(0, 0, -kCentre_m), Vec3(0, 0, kHeight_m - kCentre_m)};
    for (int i = 0; i < kSides; ++i) {
      const double angle = 2.0 * kPi * i / kSides;
      cone.vertices.emplace_back(kRadius_m * std::cos(angle), kRadius_m * std::sin(angle), kHeight_m - kCentre_m);
      const auto mine = static_cast<std::uint32_t>(i + 2), next = static_cast<std::uint32_t>((i + 1) % kSides + 2);
      cone.triangles.push_back({0, next, mine});
      cone.triangles.push_back({1, mine, next});
    }
    return cone;
  }
  [[nodiscard]] Body body() const {
    Body top;
    top.shape.kind = ShapeKind::convex;
    top.material.friction = 1.0;
    top.mass = kMass_kg;
    top.inertia = Vec3(i_centre, i_centre, i3);
    return top;
  }
};

/// Mean angular speed of the axis about the vertical, started in steady precession; 0 if the top falls.
Measurement top_precession(const EngineSetting& setting, double w3_rad_s) {
  constexpr double kFor_s = 1.5;
  const Top top;
  TestBed bed(setting, Vec3(0, 0, -kG), {Top::mesh()});
  bed.add_floor({.friction = 1.0});
  BodyState start = placed(Vec3::Zero(), turned(Top::kTilt_deg * kDegree, Vec3::UnitY()));
  const Vec3 axis = start.orientation * Vec3::UnitZ();
  start.position = Top::kCentre_m * axis;
  const double precession = top.precession(w3_rad_s);
  start.angular_velocity = precession * Vec3::UnitZ() + (w3_rad_s - precession * axis.z()) * axis;
  start.linear_velocity = start.angular_velocity.cross(start.position);
  const BodyId id = bed.add(top.body(), start);
  double turned_rad = 0.0;
  Vec3 before = axis;
  const bool stood = bed.run(kFor_s, [&] {
    const Vec3 now = bed.state(id).orientation * Vec3::UnitZ();
    turned_rad += std::atan2(before.x() * now.y() - before.y() * now.x(), before.x() * now.x() + before.y() * now.y());
    before = now;
    return now.z() > std::cos(2.0 * Top::kTilt_deg * kDegree);
  });
  return {stood ? turned_rad / bed.time_s() : 0.0};
}

constexpr double kDisc_m = 0.05;

/// Time at which a body that spins about the vertical on a floor has lost 98 % of its rate, divided by 0.98 (linear
/// decay).
Measurement spin_stop(const EngineSetting& setting, double rate_rad_s) {
  constexpr double kLost = 0.98, kLongest_s = 5.0;
  TestBed bed(setting);
  bed.add_floor();
  const BodyId disc = bed.add(cylinder_body(kDisc_m, 0.02, 1.0), Vec3(0, 0, 0.01));
  bed.run(0.2);
  bed.engine().set_velocity(disc, Vec3::Zero(), rate_rad_s * Vec3::UnitZ());
  const double start_s = bed.time_s();
  bed.run(kLongest_s, [&] { return bed.state(disc).angular_velocity.z() > (1.0 - kLost) * rate_rad_s; });
  return {(bed.time_s() - start_s) / kLost};
}

Measurement spin_kept(const EngineSetting& setting, const Body& body, bool on_floor, double rate_rad_s) {
  TestBed bed(setting, on_floor ? Vec3(0, 0, -kG) : Vec3::Zero());
  if (on_floor) bed.add_floor();
  const BodyId id = bed.add(body, Vec3(0, 0, kDisc_m));
  bed.engine().set_velocity(id, Vec3::Zero(), rate_rad_s * Vec3::UnitZ());
  bed.run(1.0);
  return {bed.state(id).angular_velocity.z()};
}

const char* const kEuler = "Euler's equations (Landau and Lifshitz, Mechanics, 3rd ed., section 36)";

std::vector<StabilityCase> free_cases() {
  return {
      {.name = "tumble_energy",
       .shows = "A brick that tumbles in space about its middle axis keeps its energy for 10 s.",
       .parameter = "rate",
       .parameter_unit = "rad/s",
       .values = {10.0, 100.0, 1000.0},
       .quantity = "largest change",
       .unit = "%",
       .formula = "0: w.I w / 2 is constant",
       .source = kEuler,
       .compare = Compare::absolute,
       .tolerance = 1.0,
       .why = "1 % of the energy is 0.5 % of the rate",
       .measure = free_energy},
      {.name = "tumble_momentum",
       .shows = "It keeps its angular momentum, size and direction, for 10 s.",
       .parameter = "rate",
       .parameter_unit = "rad/s",
       .values = {10.0, 3.0},
       .quantity = "largest change",
       .unit = "%",
       .formula = "0: L = R I w is constant in space, w from the poses of neighbouring steps",
       .source = kEuler,
       .compare = Compare::absolute,
       .tolerance = 1.0,
       .why = "1 % aside is half a degree",
       .measure = free_momentum},
      {.name = "tumble_pose",
       .shows = "After 2 s it is turned as Euler's equations say.",
       .parameter = "rate",
       .parameter_unit = "rad/s",
       .values = {5.0, 10.0},
       .quantity = "angle to the reference",
       .unit = "deg",
       .formula = "I dw/dt = I w x w",
       .source = std::string("Converged run: ") + kEuler + " by classical Runge-Kutta in steps of 0.1 ms",
       .compare = Compare::absolute,
       .tolerance = 2.0,
       .why = "an edge that is 2 degrees aside is seen",
       .measure = free_pose},
      {.name = "flip_period",
       .shows = "A body that spins about its middle axis turns over, again and again (Dzhanibekov).",
       .parameter = "rate",
       .parameter_unit = "rad/s",
       .values = {10.0, 30.0},
       .quantity = "period",
       .unit = "s",
       .formula = "4 K(k) sqrt(I1 I2 I3 / ((I3 - I2)(L^2 - 2 E I1)))",
       .source = "Landau and Lifshitz, Mechanics, 3rd ed., section 37, equation 37.12",
       .tolerance = 0.02,
       .why = "2 % of a time is the least that is noticed of a rhythm",
       .expected = flip_period_s,
       .measure = flip_period},
      {.name = "fast_spin",
       .shows = "A cube keeps spinning in space at the rate of a grinder.",
       .parameter = "rate",
       .parameter_unit = "rad/s",
       .values = {1000.0, 100.0},
       .quantity = "rate after 1 s",
       .unit = "rad/s",
       .formula = "w: no torque",
       .source = kEuler,
       .tolerance = 0.01,
       .why = "1 % of the rate, as for rolling",
       .expected = [](double w) { return w; },
       .measure = [](const EngineSetting& s, double w) { return spin_kept(s, cube_body(0.1, 1.0), false, w); }},
  };
}

std::vector<StabilityCase> spinning_cases() {
  return {
      {.name = "spin_disc",
       .shows = "A disc that spins flat on the floor stops at the time of a uniform pressure.",
       .parameter = "rate",
       .parameter_unit = "rad/s",
       .values = {40.0},
       .quantity = "time until it stops",
       .unit = "s",
       .formula = "3 R w0 / (4 mu g), from dw/dt = -4 mu g / (3 R)",
       .source = "Coulomb friction of an even pressure (Farkas, Bartels, Unger and Wolf, Phys. Rev. Lett. 90, 2003)",
       .tolerance = 0.05,
       .why = "5 % of a time is noticed beside a real disc; a ring of points on the rim stops it in 2/3",
       .expected = [](double w) { return disc_spin_s(w, kDisc_m, kMu); },
       .measure = spin_stop},
      {.name = "spin_ball",
       .shows = "A ball that spins about the vertical on a floor keeps spinning: its single point of contact has no "
                "lever arm.",
       .parameter = "rate",
       .parameter_unit = "rad/s",
       .values = {20.0},
       .quantity = "rate after 1 s",
       .unit = "rad/s",
       .formula = "w0: Coulomb friction at a point has no moment",
       .source = "Coulomb's law of dry friction: the force acts at the point of contact, on the axis",
       .tolerance = 0.01,
       .why = "1 % of the rate, as for rolling",
       .expected = [](double w) { return w; },
       .measure = [](const EngineSetting& s, double w) { return spin_kept(s, ball_body(kDisc_m, 1.0), true, w); }},
      {.name = "top_precession",
       .shows = "A heavy top on its tip, a cone of 32 sides, precesses steadily at a tilt of 20 degrees.",
       .parameter = "spin",
       .parameter_unit = "rad/s",
       .values = {150.0, 60.0},
       .quantity = "precession",
       .unit = "rad/s",
       .formula = "m g l = W (I3 w3 - I1 W cos(20 deg)); about m g l / (I3 w3)",
       .source = "Goldstein, Classical Mechanics, 3rd ed., section 5.7",
       .tolerance = 0.05,
       .why = "5 % of a slow turn is noticed beside a real top",
       .expected = [](double w3) { return Top().precession(w3); },
       .measure = top_precession},
  };
}

}  // namespace

std::vector<StabilityCase> rotation_cases() {
  std::vector<StabilityCase> cases = free_cases();
  for (StabilityCase& one : spinning_cases()) cases.push_back(std::move(one));
  return cases;
}

}  // namespace subworld
