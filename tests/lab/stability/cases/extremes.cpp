// Extreme scenes: fast bodies, overlaps, unusual friction, unequal masses.

#include "lab/stability/bed.hpp"
#include "lab/stability/cases/cases.hpp"
#include "model/scene/scene_layout.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr double kExtremeSide_m = 0.1;

/// Whether a plate stops a ball, for several times of the impact within a step.
bool stopped_by_plate(const EngineSetting& setting, double speed_m_s) {
  constexpr double kBall_m = 0.0025, kPlate_m = 0.01, kWay_m = 0.05;
  constexpr int kPhases = 8;
  for (int phase = 0; phase < kPhases; ++phase) {
    TestBed bed(setting, Vec3::Zero());
    bed.add(box_body(Vec3(kPlate_m, 0.4, 0.4), 0.0), Vec3::Zero());
    const double ahead_m = speed_m_s * setting.dt_s * phase / kPhases;
    const BodyId ball = bed.add(ball_body(kBall_m, 0.005), Vec3(-kWay_m - ahead_m, 0.011, 0.007));
    bed.engine().set_velocity(ball, Vec3(speed_m_s, 0, 0), Vec3::Zero());
    bed.run(2.0 * (kWay_m + ahead_m) / speed_m_s + 10.0 * setting.dt_s);
    if (bed.position(ball).x() > 0.0) return false;
  }
  return true;
}

/// Two cubes without gravity that overlap by this share of a side.
struct Overlapping {
  Overlapping(const EngineSetting& setting, double part) : bed(setting, Vec3::Zero()) {
    for (const double side : {-0.5, 0.5})
      bed.add(cube_body(kExtremeSide_m, 1.0), Vec3(side * (1.0 - part) * kExtremeSide_m, 0, 0));
    bed.run(1.0, [&] {
      fastest_m_s = std::max(fastest_m_s, bed.fastest_m_s());
      return true;
    });
    overlap_m = std::max(0.0, kExtremeSide_m - (bed.position(BodyId{1}) - bed.position(BodyId{0})).norm());
  }
  TestBed bed;
  double fastest_m_s = 0.0;
  double overlap_m = 0.0;
};

/// The largest push, relative to mu times the weight, under which a thin plate stays: slower than 1 mm/s after 2 s.
Measurement friction_limit(const EngineSetting& setting, double mu) {
  constexpr double kExtremeSettle_s = 0.2, kPush_s = 2.0, kMoves_m_s = 1e-3, kGone_m_s = 0.1;
  const auto stays = [&](double push) {
    TestBed bed(setting);
    bed.add_floor({.friction = mu});
    const BodyId plate = bed.add(box_body(Vec3(2.0, 2.0, 0.004), 1.0, {.friction = mu}), Vec3(0, 0, 0.002));
    bed.run(kExtremeSettle_s);
    const auto speed_m_s = [&] { return std::abs(bed.state(plate).linear_velocity.x()); };
    return bed.run(kPush_s, [&] {
      bed.engine().apply_force(plate, push * mu * kG * Vec3::UnitX(), Vec3::Zero());
      return speed_m_s() < kGone_m_s;
    }) && speed_m_s() < kMoves_m_s;
  };
  return limit_at(find_limit({.from = 0.25, .to = 4.0, .stride = 1.5, .precision = 1.002}, stays));
}

Measurement without_friction(const EngineSetting& setting, double speed_m_s) {
  TestBed bed(setting);
  bed.add_floor({.friction = 0.0});
  const BodyId cube = bed.add(cube_body(kExtremeSide_m, 1.0, {.friction = 0.0}), Vec3(0, 0, 0.5 * kExtremeSide_m));
  bed.engine().set_velocity(cube, Vec3(speed_m_s, 0, 0), Vec3::Zero());
  bed.run(2.0);
  return {bed.state(cube).linear_velocity.x()};
}

/// The largest rise of the mechanical energy of cubes poured into a bin above its least value so far, in percent of the
/// start. The masses are spread evenly over this number of decades.
Measurement heap_energy(const EngineSetting& setting, double decades) {
  constexpr int kCubes = 40;
  constexpr double kGolden = 0.6180339887, kBin_m = 0.4, kFor_s = 2.0;
  TestBed bed(setting);
  bed.add_bin(kBin_m);
  const HeapLayout poured{.count = kCubes,
                          .area = {kBin_m, kBin_m},
                          .seed = 1,
                          .half_extents = Vec3::Constant(0.5 * kExtremeSide_m),
                          .bounding_radius = 0.5 * kExtremeSide_m * std::sqrt(3.0)};
  double spread = 0.0;
  for (const Pose& pose : lay_out(poured)) {
    spread = std::fmod(spread + kGolden, 1.0);
    bed.add(cube_body(kExtremeSide_m, std::pow(10.0, decades * (spread - 0.5))),
            placed(pose.position, pose.orientation));
  }
  const double start_j = bed.energy_j();
  double least_j = start_j, most_j = 0.0;
  bed.run(kFor_s, [&] {
    const double now_j = bed.energy_j();
    least_j = std::min(least_j, now_j);
    most_j = std::max(most_j, now_j - least_j);
    return most_j < 1e3 * start_j;
  });
  return {1e2 * most_j / start_j};
}

}  // namespace

std::vector<StabilityCase> extreme_cases() {
  const char* const coulomb = "Coulomb's law of dry friction (Beer and Johnston, Vector Mechanics: Statics, chapter 8)";
  const char* const conservation = "Conservation of energy: contacts and friction do no positive work";
  return {
      {.name = "tunnel_speed",
       .shows = "The fastest ball of 5 mm that a fixed plate of 10 mm stops, at eight places within a step.",
       .quantity = "speed",
       .unit = "m/s",
       .formula = "no limit for solid bodies; sqrt(2 g 1.3 m) = 5 m/s is required; half the "
                  "plate and the radius a step without a look ahead: 7.5 mm / dt",
       .source = "Free fall from 1.3 m (Galilei)",
       .compare = Compare::at_least,
       .tolerance = 1.0,
       .why = "a part that an operator drops onto the floor",
       .expected = [](double) { return 5.0; },
       .measure =
           [](const EngineSetting& s, double) {
             return limit_proven(find_limit({.from = 0.1, .to = 1000.0, .stride = 2.0, .precision = 1.05},
                                            [&](double speed) { return stopped_by_plate(s, speed); }));
           }},
      {.name = "overlap_speed",
       .shows = "Cubes that overlap at the start separate without an explosion.",
       .parameter = "overlap, of the side",
       .values = {0.1, 0.5},
       .quantity = "largest speed in 1 s",
       .unit = "m/s",
       .formula = "0: bodies at rest without loads have no energy to gain",
       .source = conservation,
       .compare = Compare::absolute,
       .tolerance = 0.5,
       .why = "0.5 m/s is as fast as an operator can follow a part",
       .measure = [](const EngineSetting& s, double part) { return Measurement{Overlapping(s, part).fastest_m_s}; }},
      {.name = "overlap_left",
       .shows = "They separate within 1 s.",
       .parameter = "overlap, of the side",
       .values = {0.1, 0.5},
       .quantity = "remaining overlap",
       .unit = "mm",
       .formula = "0: solid bodies do not overlap",
       .source = "Geometry: centres a side apart",
       .compare = Compare::absolute,
       .tolerance = 1.0,
       .why = "1 % of the side, as for other bodies that sink",
       .measure = [](const EngineSetting& s,
                     double part) { return Measurement{1e3 * Overlapping(s, part).overlap_m}; }},
      {.name = "friction_limit",
       .shows =
           "The largest push under which a plate does not move, from almost no friction to more than any material has.",
       .parameter = "friction",
       .values = {0.01, 100.0, 0.1, 1.0, 10.0},
       .quantity = "push, of mu times the weight",
       .unit = "",
       .formula = "1: F = mu m g; stays: slower than 1 mm/s after 2 s",
       .source = coulomb,
       .tolerance = 0.02,
       .why = "a third of the just noticeable difference of a force",
       .expected = [](double) { return 1.0; },
       .measure = friction_limit},
      {.name = "friction_zero",
       .shows = "Without friction a cube slides for 2 s at its speed.",
       .parameter = "speed",
       .parameter_unit = "m/s",
       .values = {1.0},
       .quantity = "speed after 2 s",
       .unit = "m/s",
       .formula = "v",
       .source = "Newton's first law",
       .tolerance = 0.01,
       .why = "1 % of the speed, as for rolling",
       .expected = [](double v) { return v; },
       .measure = without_friction},
      {.name = "heap_energy",
       .shows = "Cubes of very unequal masses that are poured into a bin gain no energy.",
       .parameter = "masses over decades",
       .values = {4.0, 0.0, 2.0},
       .quantity = "largest rise of energy, of the start",
       .unit = "%",
       .formula = "0: E(t) never rises; largest (E(t) - least E before t) / E0",
       .source = conservation,
       .compare = Compare::absolute,
       .tolerance = 1.0,
       .why = "1 % lifts a light cube, which has a hundredth of the heap's weight, by the height of the heap",
       .measure = heap_energy},
  };
}

}  // namespace subworld
