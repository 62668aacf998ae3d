// Coulomb friction: bodies that slide, roll, slip and tip.

#include "lab/stability/bed.hpp"
#include "lab/stability/cases/cases.hpp"
#include "lab/stability/formulas.hpp"

#include <cmath>

namespace subworld {

namespace {

constexpr double kSlidingSide_m = 0.1;
constexpr double kRollingRadius_m = 0.05;
constexpr double kSlidingSettle_s = 0.2;
constexpr double kBall = 0.4, kCylinder = 0.5;  ///< I / (m r^2)
constexpr double kRollFor_s = 1.0;
/// A cube above the slip angle by 1 % of it moves five times as far in kSlipFor_s.
constexpr double kSlipped_m = 0.005;
constexpr double kSlipFor_s = 1.0;
constexpr double kTipped_deg = 5.0;
constexpr double kCreepFor_s = 5.0;
constexpr double kBelowSlip = 0.9;  ///< relative to mu: tangent of a slope on which nothing may move

/// Displacement at which a cube with this initial velocity stops.
Vec3 slide(const EngineSetting& setting, const Vec3& velocity) {
  TestBed bed(setting);
  bed.add_floor();
  const BodyId cube = bed.add(cube_body(kSlidingSide_m, 1.0), Vec3(0, 0, 0.5 * kSlidingSide_m));
  bed.run(kSlidingSettle_s);
  const Vec3 start = bed.position(cube);
  bed.engine().set_velocity(cube, velocity, Vec3::Zero());
  bed.run(velocity.norm() / (kMu * kG) + 0.5);
  return bed.position(cube) - start;
}

Vec3 heading(double degrees) { return {std::cos(degrees * kDegree), std::sin(degrees * kDegree), 0.0}; }

/// A round body on the floor, axis y, with a velocity along x.
struct Roller {
  Roller(const EngineSetting& setting, double k, double speed_m_s, double spin_rad_s) : bed(setting) {
    bed.add_floor();
    const Body shape =
        k == kBall ? ball_body(kRollingRadius_m, 1.0) : cylinder_body(kRollingRadius_m, kSlidingSide_m, 1.0);
    body = bed.add(shape, placed(Vec3(0, 0, kRollingRadius_m), turned(0.5 * kPi, Vec3::UnitX())));
    bed.engine().set_velocity(body, Vec3(speed_m_s, 0, 0), Vec3(0, spin_rad_s, 0));
    bed.run(kRollFor_s);
  }
  TestBed bed;
  BodyId body{};
};

Measurement rolled_speed(const EngineSetting& setting, double k, double speed_m_s) {
  const Roller roller(setting, k, speed_m_s, speed_m_s / kRollingRadius_m);
  return {roller.bed.state(roller.body).linear_velocity.x()};
}

/// A cube on a plane; gravity is tilted instead of the plane.
Vec3 tilted_gravity(double degrees) { return kG * Vec3(std::sin(degrees * kDegree), 0, -std::cos(degrees * kDegree)); }

bool stays_on_slope(const EngineSetting& setting, double mu, double degrees) {
  TestBed bed(setting, tilted_gravity(degrees));
  bed.add_floor({.friction = mu});
  bed.add(cube_body(kSlidingSide_m, 1.0, {.friction = mu}), Vec3(0, 0, 0.5 * kSlidingSide_m));
  return bed.run(kSlipFor_s, [&] { return bed.moved_m() < kSlipped_m; });
}

bool stays_upright(const EngineSetting& setting, double width_over_height, double degrees) {
  constexpr double kNoSlip = 10.0;
  TestBed bed(setting, tilted_gravity(degrees));
  bed.add_floor({.friction = kNoSlip});
  const Vec3 size(width_over_height * 0.2, 0.1, 0.2);
  const BodyId box = bed.add(box_body(size, 1.0, {.friction = kNoSlip}), Vec3(0, 0, 0.5 * size.z()));
  return bed.run(2.0,
                 [&] { return (bed.state(box).orientation * Vec3::UnitZ()).z() > std::cos(kTipped_deg * kDegree); });
}

Measurement creep(const EngineSetting& setting, double mu) {
  TestBed bed(setting, tilted_gravity(std::atan(kBelowSlip * mu) / kDegree));
  bed.add_floor({.friction = mu});
  const BodyId cube = bed.add(cube_body(kSlidingSide_m, 1.0, {.friction = mu}), Vec3(0, 0, 0.5 * kSlidingSide_m));
  bed.run(kSlidingSettle_s);
  const Vec3 start = bed.position(cube);
  bed.run(kCreepFor_s);
  return {1e3 * (bed.position(cube) - start).norm()};
}

Search around_angle(double expected) {
  return {.from = 0.5 * expected, .to = 2.0 * expected, .stride = 1.2, .precision = 1.002};
}

const char* const kCoulomb = "Coulomb's law of dry friction (Beer and Johnston, Vector Mechanics: Statics, chapter 8)";
const char* const kBilliards =
    "G.-G. Coriolis, Theorie mathematique des effets du jeu de billard, 1835; friction mu g until v = w r";

std::vector<StabilityCase> friction_cases() {
  return {
      {.name = "slide_stop",
       .shows = "A cube that slides on a floor stops at the distance of Coulomb friction.",
       .parameter = "speed",
       .parameter_unit = "m/s",
       .values = {1.0, 0.3, 3.0},
       .quantity = "distance",
       .unit = "m",
       .formula = "v^2 / (2 mu g), mu = 0.5",
       .source = kCoulomb,
       .tolerance = 0.02,
       .why = "2 % of the way is where an eye that compares two marks begins to see a difference",
       .expected = [](double v) { return slide_distance_m(v, kMu); },
       .measure = [](const EngineSetting& s, double v) { return Measurement{slide(s, Vec3(v, 0, 0)).x()}; }},
      {.name = "slide_sideways",
       .shows = "Friction acts against the motion in every direction: a cube that slides obliquely to its sides and to "
                "the axes keeps its line.",
       .parameter = "heading",
       .parameter_unit = "deg",
       .values = {22.5, 10.0, 45.0},
       .quantity = "distance from the line, of the way",
       .unit = "%",
       .formula = "0: friction is isotropic",
       .source = kCoulomb,
       .compare = Compare::absolute,
       .tolerance = 2.0,
       .why = "2 % sideways is a bend of 1 degree, which is seen along a straight edge",
       .measure =
           [](const EngineSetting& s, double degrees) {
             const Vec3 along = heading(degrees), way = slide(s, along);
             return Measurement{1e2 * std::abs(along.cross(way).z()) / std::abs(along.dot(way))};
           }},
      {.name = "slip_angle",
       .shows = "The steepest slope on which a cube stays.",
       .parameter = "friction",
       .parameter_unit = "",
       .values = {0.5, 0.2, 0.8},
       .quantity = "slip angle",
       .unit = "deg",
       .formula = "atan(mu); stays: less than 5 mm in 1 s",
       .source = kCoulomb,
       .tolerance = 0.01,
       .why = "1 % is 0.3 degrees at mu = 0.5; above it a cube that should stay is 26 mm away after 1 s",
       .expected = slip_angle_deg,
       .measure =
           [](const EngineSetting& s, double mu) {
             return limit_at(find_limit(around_angle(slip_angle_deg(mu)),
                                        [&](double degrees) { return stays_on_slope(s, mu, degrees); }));
           }},
      {.name = "tip_angle",
       .shows = "The steepest slope on which a box that cannot slip stays upright.",
       .parameter = "width / height",
       .parameter_unit = "",
       .values = {0.5, 0.25},
       .quantity = "tip angle",
       .unit = "deg",
       .formula = "atan(w / h)",
       .source = "Statics: the weight passes through the lower edge (Beer and Johnston, Vector Mechanics: Statics, "
                 "chapter 8)",
       .tolerance = 0.01,
       .why = "1 % of the angle is 1 % of the width: an edge that lies 1 mm aside in 100 mm",
       .expected = tip_angle_deg,
       .measure =
           [](const EngineSetting& s, double ratio) {
             return limit_at(find_limit(around_angle(tip_angle_deg(ratio)),
                                        [&](double degrees) { return stays_upright(s, ratio, degrees); }));
           }},
      {.name = "slope_creep",
       .shows = "A cube on a slope below the slip angle does not creep.",
       .parameter = "friction",
       .parameter_unit = "",
       .values = {0.5, 0.9},
       .quantity = "way in 5 s",
       .unit = "mm",
       .formula = "0 where tan(slope) = 0.9 mu < mu",
       .source = kCoulomb,
       .compare = Compare::absolute,
       .tolerance = 1.0,
       .why = "1 mm in 5 s is seen: the user sees that the cube has moved",
       .measure = creep},
  };
}

/// Cases of a thrown round body, after kRollFor_s.
std::vector<StabilityCase> rolling_cases() {
  struct Round {
    const char* name;
    const char* speed_formula;
    const char* place_formula;
    double k;
  };
  std::vector<StabilityCase> cases;
  for (const Round& round : {Round{"ball", "5/7 v0", "12 v0^2 / (49 mu g) sliding, then 5/7 v0", kBall},
                             Round{"cylinder", "2/3 v0", "5 v0^2 / (18 mu g) sliding, then 2/3 v0", kCylinder}}) {
    const std::string name = round.name;
    const double k = round.k;
    cases.push_back({.name = "roll_" + name,
                     .shows = "A " + name + " that rolls without slip keeps its speed for 1 s.",
                     .parameter = "speed",
                     .parameter_unit = "m/s",
                     .values = {1.0, 0.1},
                     .quantity = "speed after 1 s",
                     .unit = "m/s",
                     .formula = "v: the point of contact is at rest, so friction does no work",
                     .source = kBilliards,
                     .tolerance = 0.01,
                     .why = "1 % of the speed is 1 % of the way, half of what is seen",
                     .expected = [](double v) { return v; },
                     .measure = [k](const EngineSetting& s, double v) { return rolled_speed(s, k, v); }});
    cases.push_back(
        {.name = "throw_speed_" + name,
         .shows = "A " + name + " thrown without spin slides, then rolls at a speed that does not depend on friction.",
         .parameter = "speed",
         .parameter_unit = "m/s",
         .values = {1.0},
         .quantity = "speed in the end",
         .unit = "m/s",
         .formula = round.speed_formula,
         .source = kBilliards,
         .tolerance = 0.02,
         .why = "as for a way: 2 % begins to be seen",
         .expected = [k](double v) { return slide_to_roll(v, k, kMu).speed_m_s; },
         .measure =
             [k](const EngineSetting& s, double v) {
               const Roller roller(s, k, v, 0.0);
               return Measurement{roller.bed.state(roller.body).linear_velocity.x()};
             }});
    cases.push_back({.name = "throw_place_" + name,
                     .shows = "Where that " + name + " is after 1 s.",
                     .parameter = "speed",
                     .parameter_unit = "m/s",
                     .values = {1.0},
                     .quantity = "place",
                     .unit = "m",
                     .formula = round.place_formula,
                     .source = kBilliards,
                     .tolerance = 0.02,
                     .why = "2 % of the way, as for a cube that slides",
                     .expected = [k](double v) { return slide_to_roll(v, k, kMu).place_m(kRollFor_s); },
                     .measure =
                         [k](const EngineSetting& s, double v) {
                           const Roller roller(s, k, v, 0.0);
                           return Measurement{roller.bed.position(roller.body).x()};
                         }});
  }
  return cases;
}

}  // namespace

std::vector<StabilityCase> sliding_cases() {
  std::vector<StabilityCase> cases = friction_cases();
  for (StabilityCase& one : rolling_cases()) cases.push_back(std::move(one));
  return cases;
}

}  // namespace subworld
