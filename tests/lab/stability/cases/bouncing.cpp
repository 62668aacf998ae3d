// Newton's restitution: speed after an impact, without gain of energy.

#include "lab/stability/bed.hpp"
#include "lab/stability/cases/cases.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr double kBouncingRadius_m = 0.05;
constexpr double kDrop_m = 0.5;
constexpr double kBounceFor_s = 10.0;
constexpr double kRunaway = 1e5;  ///< percent; a larger gain gives no further information

/// Height of the first bounce over that of the fall.
Measurement bounce(const EngineSetting& setting, double restitution) {
  TestBed bed(setting);
  bed.add_floor({.restitution = 1.0});
  const BodyId ball =
      bed.add(ball_body(kBouncingRadius_m, 1.0, {.restitution = restitution}), Vec3(0, 0, kBouncingRadius_m + kDrop_m));
  double top_m = 0.0;
  bool rising = false;
  bed.run(2.0, [&] {
    const BodyState now = bed.state(ball);
    const bool was_rising = rising;
    rising = now.linear_velocity.z() > 0.0;
    if (rising || was_rising) top_m = std::max(top_m, now.position.z() - kBouncingRadius_m);
    return rising || !was_rising;
  });
  return {top_m / kDrop_m};
}

/// Rise and drop of the mechanical energy of a falling and bouncing body against its start, in percent of the energy of
/// the fall.
struct EnergyCourse {
  double rise = 0.0;
  double drop = 0.0;
};
EnergyCourse energy_course(const EngineSetting& setting, Body ground, Body body, double tilt_deg, double friction) {
  const Quat tilt = turned(tilt_deg * kDegree, Vec3(1, 2, 3).normalized());
  const double reach_m =
      body.shape.radius + body.shape.half_extents.dot(tilt.toRotationMatrix().row(2).transpose().cwiseAbs());
  body.material = ground.material = {.friction = friction, .restitution = 1.0};
  TestBed bed(setting);
  bed.add(ground, Vec3(0, 0, -ground.shape.half_extents.z()));
  bed.add(body, placed(Vec3(0, 0, reach_m + kDrop_m), tilt));
  const double start_j = bed.energy_j(), fallen_j = body.mass * kG * kDrop_m;
  EnergyCourse course;
  bed.run(kBounceFor_s, [&] {
    const double change = 1e2 * (bed.energy_j() - start_j) / fallen_j;
    course.rise = std::max(course.rise, change);
    course.drop = std::max(course.drop, -change);
    return course.rise < kRunaway;
  });
  return course;
}

Measurement energy_change(const EnergyCourse& course) { return {std::max(course.rise, course.drop)}; }

/// Speed of the last of five balls in a row after the first one hits at 1 m/s.
Measurement cradle(const EngineSetting& setting, double gap_mm) {
  constexpr int kBalls = 5;
  constexpr double kBall_m = 0.02;
  TestBed bed(setting, Vec3::Zero());
  const Body ball = ball_body(kBall_m, 0.1, {.friction = 0.0, .restitution = 1.0});
  for (int i = 0; i < kBalls; ++i) {
    const double run_up_m = i == 0 ? 0.05 : 0.0;
    bed.add(ball, Vec3(i * (2.0 * kBall_m + 1e-3 * gap_mm) - run_up_m, 0, 0));
  }
  bed.engine().set_velocity(BodyId{0}, Vec3::UnitX(), Vec3::Zero());
  bed.run(0.3);
  return {bed.state(BodyId{kBalls - 1}).linear_velocity.x()};
}

const char* const kNewton = "Newton's law of restitution: v' = -e v (Principia, Scholium to the Laws)";

}  // namespace

std::vector<StabilityCase> bouncing_cases() {
  return {
      {.name = "bounce",
       .shows = "A ball that falls from 0.5 m rises by the square of its restitution.",
       .parameter = "restitution",
       .values = {0.5, 1.0, 0.3, 0.8},
       .quantity = "height of the bounce, of the fall",
       .unit = "",
       .formula = "e^2",
       .source = kNewton,
       .compare = Compare::absolute,
       .tolerance = 0.02,
       .why = "2 % of the fall is 10 mm here",
       .expected = [](double e) { return e * e; },
       .measure = bounce},
      {.name = "bounce_energy_ball",
       .shows = "A ball that bounces without loss for 10 s neither gains nor loses energy.",
       .quantity = "largest change of energy, of that of the fall",
       .unit = "%",
       .formula = "0 for e = 1, mu = 0",
       .source = kNewton,
       .compare = Compare::absolute,
       .tolerance = 5.0,
       .why = "5 % is a bounce that is 25 mm higher or lower after ten seconds",
       .measure =
           [](const EngineSetting& s, double) {
             return energy_change(energy_course(s, plane_body(), ball_body(kBouncingRadius_m, 1.0), 0.0, 0.0));
           }},
      {.name = "bounce_energy_cube",
       .shows = "The same with a cube that lands on a face, or on a corner and then tumbles.",
       .parameter = "tilt",
       .parameter_unit = "deg",
       .values = {0.0, 40.0},
       .quick_values = 2,
       .quantity = "largest change of energy, of that of the fall",
       .unit = "%",
       .formula = "0 for e = 1, mu = 0",
       .source = kNewton,
       .compare = Compare::absolute,
       .tolerance = 5.0,
       .why = "as for the ball",
       .measure =
           [](const EngineSetting& s, double tilt_deg) {
             return energy_change(
                 energy_course(s, plane_body(), cube_body(2.0 * kBouncingRadius_m, 1.0), tilt_deg, 0.0));
           }},
      {.name = "bounce_gain_cube",
       .shows = "With friction, on a box as large as a room, that cube may lose energy and gains none.",
       .parameter = "tilt",
       .parameter_unit = "deg",
       .values = {40.0, 0.0, 20.0, 70.0},
       .quantity = "largest rise of energy, of that of the fall",
       .unit = "%",
       .formula = "0 for e = 1, mu = 0.5: friction takes energy",
       .source = "Conservation of energy; Newton's law of restitution alone does not guarantee it (Kane and Levinson, "
                 "Dynamics, 1985)",
       .compare = Compare::absolute,
       .tolerance = 5.0,
       .why = "as for the ball",
       .measure =
           [](const EngineSetting& s, double tilt_deg) {
             return Measurement{energy_course(s, box_body(Vec3(20, 20, 1), 0.0),
                                              cube_body(2.0 * kBouncingRadius_m, 1.0), tilt_deg, kMu)
                                    .rise};
           }},
      {.name = "newtons_cradle",
       .shows = "Of five equal balls in a row only the last moves after the first has hit, whether they touch or not.",
       .parameter = "gap",
       .parameter_unit = "mm",
       .values = {5.0, 0.0},
       .quantity = "speed of the last",
       .unit = "m/s",
       .formula = "v0 = 1 m/s",
       .source =
           "Momentum and energy of a chain of impacts between equal masses (Herrmann and Schmaelzle, Am. J. Phys. "
           "49, 1981)",
       .tolerance = 0.05,
       .why = "5 % of the speed are 10 % of the height to which the last ball rises, a visible difference",
       .expected = [](double) { return 1.0; },
       .measure = cradle},
  };
}

}  // namespace subworld
