// Bodies at rest: penetration, residual motion and forces.

#include "lab/stability/bed.hpp"
#include "lab/stability/cases/cases.hpp"
#include "lab/stability/formulas.hpp"
#include "model/scene/scene_layout.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr double kRestingSide_m = 0.1;
constexpr double kRestingSettle_s = 1.0;
constexpr double kLook_s = 1.0;
constexpr double kRestingRadius_m = 0.05;

/// A cube on the floor, settled.
struct Resting {
  Resting(const EngineSetting& setting, double mass_kg) : bed(setting) {
    bed.add_floor();
    cube = bed.add(cube_body(kRestingSide_m, mass_kg), Vec3(0, 0, 0.5 * kRestingSide_m));
    bed.run(kRestingSettle_s);
  }
  TestBed bed;
  BodyId cube{};
};

Measurement depth(const EngineSetting& setting, double mass_kg) {
  const Resting at_rest(setting, mass_kg);
  return {1e3 * std::abs(0.5 * kRestingSide_m - at_rest.bed.position(at_rest.cube).z())};
}

Measurement tremble(const EngineSetting& setting, double mass_kg) {
  Resting at_rest(setting, mass_kg);
  double most_m_s = 0.0;
  at_rest.bed.run(kLook_s, [&] {
    most_m_s = std::max(most_m_s, at_rest.bed.fastest_m_s());
    return true;
  });
  return {1e3 * most_m_s};
}

/// Normal force of one body on others over the last step, N.
double normal_force_n(TestBed& bed, BodyId id) {
  double impulse_n_s = 0.0;
  for (const Contact& c : bed.engine().contacts()) {
    if (c.a == id || c.b == id) impulse_n_s += c.normal_impulse;
  }
  return impulse_n_s / bed.dt_s();
}

Measurement ripple(const EngineSetting& setting, double mass_kg) {
  Resting at_rest(setting, mass_kg);
  const double weight_n = mass_kg * kG;
  double most = 0.0;
  at_rest.bed.run(kLook_s, [&] {
    most = std::max(most, std::abs(normal_force_n(at_rest.bed, at_rest.cube) - weight_n) / weight_n);
    return true;
  });
  return {1e2 * most};
}

/// A body between two planes that meet at the origin along y, without friction. Measures the mean force of one plane
/// and the body's height.
struct Groove {
  Groove(const EngineSetting& setting, double half_angle_deg, const Body& body, const Quat& orientation,
         double height_m)
      : bed(setting) {
    for (const double side : {-1.0, 1.0}) {
      walls[side > 0.0] =
          bed.add(plane_body({.friction = 0.0}),
                  placed(Vec3::Zero(), turned(side * (90.0 - half_angle_deg) * kDegree, Vec3::UnitY())));
    }
    id = bed.add(body, placed(Vec3(0, 0, height_m), orientation));
    bed.run(kRestingSettle_s);
    int steps = 0;
    bed.run(kLook_s, [&] {
      for (const int side : {0, 1}) force_n[side] += normal_force_n(bed, walls[side]);
      height_sum_m += bed.position(id).z();
      return ++steps > 0;
    });
    for (double& force : force_n) force /= steps;
    mean_height_m = height_sum_m / steps;
  }
  TestBed bed;
  BodyId walls[2]{};
  BodyId id{};
  double force_n[2] = {0.0, 0.0};
  double height_sum_m = 0.0;
  double mean_height_m = 0.0;
};

constexpr double kGrooveMass_kg = 1.0;

Groove ball_in_groove(const EngineSetting& setting, double half_angle_deg) {
  return {setting, half_angle_deg, ball_body(kRestingRadius_m, kGrooveMass_kg, {.friction = 0.0}), Quat::Identity(),
          groove_height_m(kRestingRadius_m, half_angle_deg)};
}

/// Speed at which a lying cylinder rolls away, mm/s.
Measurement lying_cylinder(const EngineSetting& setting, const Body& ground, double top_m) {
  constexpr double kFor_s = 3.0;
  TestBed bed(setting);
  bed.add(ground, Vec3(0, 0, top_m));
  const BodyId cylinder = bed.add(cylinder_body(kRestingRadius_m, kRestingSide_m, 1.0),
                                  placed(Vec3(0.013, 0.007, kRestingRadius_m), turned(0.5 * kPi, Vec3::UnitX())));
  bed.run(kFor_s);
  const Vec3 way = bed.position(cylinder) - Vec3(0.013, 0.007, kRestingRadius_m);
  return {1e3 * way.head<2>().norm() / kFor_s};
}

/// The deepest overlap of balls in a bin with each other or the bin, in percent of their radius.
Measurement pile(const EngineSetting& setting, double count) {
  constexpr double kBall_m = 0.02, kBin_m = 0.125;
  TestBed bed(setting);
  bed.add_bin(kBin_m);
  const HeapLayout poured{.count = static_cast<int>(count),
                          .area = {kBin_m, kBin_m},
                          .max_tilt_deg = 0.0,
                          .seed = 1,
                          .half_extents = Vec3::Constant(kBall_m),
                          .bounding_radius = kBall_m};
  std::vector<BodyId> balls;
  for (const Pose& pose : lay_out(poured)) balls.push_back(bed.add(ball_body(kBall_m, 0.1), pose.position));
  bed.run(2.0);
  double deepest_m = 0.0;
  for (std::size_t i = 0; i < balls.size(); ++i) {
    const Vec3 at = bed.position(balls[i]);
    const double wall_m = 0.5 * kBin_m - at.head<2>().cwiseAbs().maxCoeff();
    deepest_m = std::max({deepest_m, kBall_m - at.z(), kBall_m - wall_m});
    for (std::size_t j = 0; j < i; ++j)
      deepest_m = std::max(deepest_m, 2.0 * kBall_m - (at - bed.position(balls[j])).norm());
  }
  return {1e2 * deepest_m / kBall_m};
}

const char* const kRestingSource = "Statics: equal weight and support";

std::vector<StabilityCase> still_cases() {
  return {
      {.name = "rest_depth",
       .shows = "A cube on the floor rests on it, without penetration and without a gap.",
       .parameter = "mass",
       .parameter_unit = "kg",
       .values = {0.2, 20.0},
       .quantity = "depth or gap",
       .unit = "mm",
       .formula = "0 for rigid bodies",
       .source = kRestingSource,
       .compare = Compare::absolute,
       .tolerance = 0.2,
       .why = "0.2 mm is one pixel where the cube of 100 mm takes 500",
       .measure = depth},
      {.name = "rest_tremble",
       .shows = "That cube does not tremble.",
       .parameter = "mass",
       .parameter_unit = "kg",
       .values = {0.2, 20.0},
       .quantity = "largest speed in 1 s",
       .unit = "mm/s",
       .formula = "0",
       .source = kRestingSource,
       .compare = Compare::absolute,
       .tolerance = 1.0,
       .why = "1 mm/s is the slowest motion that a resting finger and an eye notice",
       .measure = tremble},
      {.name = "rest_ripple",
       .shows = "The floor carries that cube with the same force in every step.",
       .parameter = "mass",
       .parameter_unit = "kg",
       .values = {0.2, 20.0},
       .quantity = "largest difference from the weight in a step",
       .unit = "%",
       .formula = "N = m g in every step",
       .source = kRestingSource,
       .compare = Compare::absolute,
       .tolerance = 7.0,
       .why = "7 % is the just noticeable difference of a force",
       .measure = ripple},
      {.name = "cylinder_on_plane",
       .shows = "A lying cylinder does not roll away on a plane.",
       .quantity = "mean speed over 3 s",
       .unit = "mm/s",
       .formula = "0",
       .source = kRestingSource,
       .compare = Compare::absolute,
       .tolerance = 1.0,
       .why = "3 mm in 3 s: the user sees that the cylinder has moved",
       .measure = [](const EngineSetting& s, double) { return lying_cylinder(s, plane_body(), 0.0); }},
      {.name = "cylinder_on_box",
       .shows = "The same on a box as large as a table.",
       .quantity = "mean speed over 3 s",
       .unit = "mm/s",
       .formula = "0",
       .source = kRestingSource,
       .compare = Compare::absolute,
       .tolerance = 1.0,
       .why = "as on the plane",
       .measure = [](const EngineSetting& s, double) { return lying_cylinder(s, box_body(Vec3(1, 1, 1), 0.0), -0.5); }},
      {.name = "ball_pile",
       .shows = "Balls that were poured into a bin do not sink into each other.",
       .parameter = "balls",
       .values = {30.0, 100.0},
       .quantity = "deepest overlap, of the radius",
       .unit = "%",
       .formula = "0 for rigid bodies",
       .source = "Geometry: centres two radii apart",
       .compare = Compare::absolute,
       .tolerance = 2.0,
       .why = "2 % of the radius is 1 % of a ball: an overlap that is seen",
       .measure = pile},
  };
}

std::vector<StabilityCase> groove_cases() {
  const char* const source =
      "Statics of a wedge without friction (Beer and Johnston, Vector Mechanics: Statics, chapter 8)";
  return {
      {.name = "groove_force",
       .shows = "Each side of a V groove carries its share of a ball.",
       .parameter = "half angle",
       .parameter_unit = "deg",
       .values = {30.0, 45.0, 10.0},
       .quantity = "normal force of a side",
       .unit = "N",
       .formula = "N = W / (2 sin(half angle)), m = 1 kg, mu = 0",
       .source = source,
       .tolerance = 0.02,
       .why = "a third of the just noticeable difference of a force",
       .expected = [](double a) { return groove_force_n(kGrooveMass_kg * kG, a); },
       .measure = [](const EngineSetting& s, double a) { return Measurement{ball_in_groove(s, a).force_n[0]}; }},
      {.name = "groove_height",
       .shows = "The height of the ball in the groove follows from its radius.",
       .parameter = "half angle",
       .parameter_unit = "deg",
       .values = {30.0, 45.0, 10.0},
       .quantity = "height of the centre",
       .unit = "m",
       .formula = "r / sin(half angle), r = 0.05 m",
       .source = "Geometry: both sides touch",
       .tolerance = 0.01,
       .why = "1 % of the height, as for other bodies that sink",
       .expected = [](double a) { return groove_height_m(kRestingRadius_m, a); },
       .measure = [](const EngineSetting& s, double a) { return Measurement{ball_in_groove(s, a).mean_height_m}; }},
      {.name = "groove_cube",
       .shows = "A cube that lies on two faces in a groove of 90 degrees loads both sides equally.",
       .quantity = "larger normal force of the two sides",
       .unit = "N",
       .formula = "N = W / (2 sin(45 deg)), m = 1 kg, mu = 0",
       .source = source,
       .tolerance = 0.02,
       .why = "as for the ball",
       .expected = [](double) { return groove_force_n(kGrooveMass_kg * kG, 45.0); },
       .measure =
           [](const EngineSetting& s, double) {
             const Groove groove(s, 45.0, cube_body(kRestingSide_m, kGrooveMass_kg, {.friction = 0.0}),
                                 turned(0.25 * kPi, Vec3::UnitY()), kRestingSide_m * std::sqrt(0.5));
             return Measurement{std::max(groove.force_n[0], groove.force_n[1])};
           }},
  };
}

}  // namespace

std::vector<StabilityCase> resting_cases() {
  std::vector<StabilityCase> cases = still_cases();
  for (StabilityCase& one : groove_cases()) cases.push_back(std::move(one));
  return cases;
}

}  // namespace subworld
