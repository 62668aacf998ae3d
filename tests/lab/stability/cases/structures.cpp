// Structures: stacks, card houses, a heavy body on a light one.

#include "lab/stability/bed.hpp"
#include "lab/stability/cases/cases.hpp"
#include "model/scene/scene_layout.hpp"

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr double kStackedSide_m = 0.1;
constexpr double kStandFor_s = 5.0;
constexpr double kTrembleFor_s = 1.0;
constexpr double kTremble_m_s = 1e-3;
constexpr double kMoved = 0.01;  ///< of the side

void pile_up(TestBed& bed, int count) {
  bed.add_floor();
  for (int i = 0; i < count; ++i) bed.add(cube_body(kStackedSide_m, 1.0), Vec3(0, 0, (i + 0.5) * kStackedSide_m));
}

/// The largest displacement of a body. A structure that has moved by `lost_m` has fallen, and the run ends.
Measurement moved_mm(TestBed& bed, double seconds, double lost_m) {
  double most_m = 0.0;
  bed.run(seconds, [&] {
    most_m = std::max(most_m, bed.moved_m());
    return most_m < lost_m;
  });
  return {1e3 * most_m};
}

Measurement stack(const EngineSetting& setting, double cubes) {
  TestBed bed(setting);
  pile_up(bed, static_cast<int>(cubes));
  return moved_mm(bed, kStandFor_s, kStackedSide_m);
}

/// As in the scene card_house, with single floors.
Measurement card_house(const EngineSetting& setting, double stages) {
  constexpr double kWatch_s = 3.0;
  TestBed bed(setting);
  bed.add_floor();
  const CardHouseLayout house{.stages = static_cast<int>(stages),
                              .lean_deg = 20.0,
                              .gap = 1e-5,
                              .card_size = Vec3(1.0, 0.7, 0.02),
                              .double_floors = {}};
  const Body card = box_body(house.card_size, 1.0);
  for (const Pose& pose : lay_out(house)) bed.add(card, placed(pose.position, pose.orientation));
  return moved_mm(bed, kWatch_s, 0.5);
}

void pile_two(TestBed& bed, double lower_kg, double upper_kg) {
  bed.add_floor();
  bed.add(cube_body(kStackedSide_m, lower_kg), Vec3(0, 0, 0.5 * kStackedSide_m));
  bed.add(cube_body(kStackedSide_m, upper_kg), Vec3(0, 0, 1.5 * kStackedSide_m));
}

/// Whether the lower of two cubes neither fails nor lets the upper one fall.
bool carries(const EngineSetting& setting, double lower_kg, double upper_kg) {
  constexpr double kGaveWay = 0.1;  // of the side
  TestBed bed(setting);
  pile_two(bed, lower_kg, upper_kg);
  return bed.run(kStandFor_s, [&] { return bed.moved_m() <= kGaveWay * kStackedSide_m; });
}

/// Whether the upper of two cubes rests on the lower one: neither moves by more than 1 % of the side or trembles.
bool rests(const EngineSetting& setting, double lower_kg, double upper_kg) {
  TestBed bed(setting);
  pile_two(bed, lower_kg, upper_kg);
  return bed.run(kStandFor_s, [&] {
    const bool settled = bed.time_s() > kStandFor_s - kTrembleFor_s;
    return bed.moved_m() <= kMoved * kStackedSide_m && !(settled && bed.fastest_m_s() > kTremble_m_s);
  });
}

/// Whether a cube of this side, of plastic, rests on a plane for 1 s without moving by more than 1 % of it.
bool small_rests(const EngineSetting& setting, double side_m) {
  constexpr double kDensity_kg_m3 = 2500.0;
  TestBed bed(setting);
  bed.add_floor();
  bed.add(cube_body(side_m, kDensity_kg_m3 * side_m * side_m * side_m), Vec3(0, 0, 0.5 * side_m));
  return bed.run(1.0, [&] { return bed.moved_m() <= kMoved * side_m; });
}

bool stands_at(EngineSetting setting, double dt_s) {
  constexpr int kCubes = 5;
  setting.dt_s = dt_s;
  TestBed bed(setting);
  pile_up(bed, kCubes);
  return bed.run(3.0, [&] { return bed.moved_m() <= 0.05 * kStackedSide_m; });
}

const char* const kStackedSource = "Statics: every body carries those above it and stays";

/// The largest ratio of the masses of two cubes, one on the other, for which they `hold`.
StabilityCase mass_case(const char* name, const char* shows, double asked_for, const char* why,
                        bool (*hold)(const EngineSetting&, double ratio)) {
  static constexpr Search kRatios{.from = 1.0, .to = 1e6, .stride = 10.0, .precision = 1.2};
  return {.name = name,
          .shows = shows,
          .quantity = "mass ratio",
          .unit = "",
          .formula = "no limit in statics; so much is asked for",
          .source = kStackedSource,
          .compare = Compare::at_least,
          .tolerance = 1.0,
          .why = why,
          .expected = [asked_for](double) { return asked_for; },
          .measure =
              [hold](const EngineSetting& s, double) {
                return limit_proven(find_limit(kRatios, [&](double ratio) { return hold(s, ratio); }));
              }};
}

std::vector<StabilityCase> limit_cases() {
  return {
      mass_case("heavy_on_light",
                "The heaviest cube that rests for 5 s on one of 1 kg: both stay within 1 % of the side and tremble by "
                "less than 1 mm/s.",
                100.0, "a tool of 10 kg on a part of 100 g",
                [](const EngineSetting& s, double ratio) { return rests(s, 1.0, ratio); }),
      mass_case("light_on_heavy", "The same with the heavy cube below.", 1000.0, "a screw of 10 g on a part of 10 kg",
                [](const EngineSetting& s, double ratio) { return rests(s, ratio, 1.0); }),
      mass_case(
          "heavy_carried",
          "The heaviest cube that one of 1 kg carries for 5 s: neither moves by a tenth of the side, however they "
          "tremble. The warnings of `subworld run` and `plan` come from here.",
          100.0, "a tool of 10 kg on a part of 100 g",
          [](const EngineSetting& s, double ratio) { return carries(s, 1.0, ratio); }),
      {.name = "smallest_cube",
       .shows = "The smallest cube that rests on a plane for 1 s without moving by more than 1 % of its side.",
       .quantity = "side",
       .unit = "mm",
       .formula = "no limit in statics; 1 mm is asked for",
       .source = kStackedSource,
       .compare = Compare::at_most,
       .tolerance = 1.0,
       .why = "small screws and washers measure 1 mm",
       .expected = [](double) { return 1.0; },
       .measure =
           [](const EngineSetting& s, double) {
             return limit_proven(find_limit({.from = 100.0, .to = 0.1, .stride = 2.0, .precision = 1.1},
                                            [&](double side_mm) { return small_rests(s, 1e-3 * side_mm); }));
           }},
      {.name = "largest_step",
       .shows =
           "The longest step in which a stack of five cubes stands for 3 s, none moved by more than 5 % of its side.",
       .quantity = "step",
       .unit = "ms",
       .formula = "no limit in statics; 1/60 s is asked for",
       .source = kStackedSource,
       .compare = Compare::at_least,
       .tolerance = 1.0,
       .why = "1/60 s is the step of a display",
       .expected = [](double) { return 1e3 / 60.0; },
       .measure =
           [](const EngineSetting& s, double) {
             return limit_proven(find_limit({.from = 1.0, .to = 100.0, .stride = 1.5, .precision = 1.05},
                                            [&](double dt_ms) { return stands_at(s, 1e-3 * dt_ms); }));
           },
       .own_step = true},
  };
}

}  // namespace

std::vector<StabilityCase> structure_cases() {
  std::vector<StabilityCase> cases{
      {.name = "stack",
       .shows = "A stack of cubes of 0.1 m stands for 5 s.",
       .parameter = "cubes",
       .values = {10.0, 20.0, 50.0, 100.0},
       .quantity = "farthest that a cube moved",
       .unit = "mm",
       .formula = "0",
       .source = kStackedSource,
       .compare = Compare::absolute,
       .tolerance = 5.0,
       .why = "5 % of the side is a step in the stack's outline",
       .measure = stack},
      {.name = "card_house",
       .shows = "A house of cards of 1 m x 0.7 m x 20 mm that lean by 20 degrees stands for 3 s by friction alone.",
       .parameter = "stages",
       .values = {3.0, 7.0},
       .quantity = "farthest that a card moved",
       .unit = "mm",
       .formula = "0: tan(20 deg) / 2 < mu = 0.5 at the foot of a card",
       .source = "Statics of leaning cards (Glondu, Marchal and Dumont 2010, section 3.2)",
       .compare = Compare::absolute,
       .tolerance = 20.0,
       .why = "a card's thickness",
       .measure = card_house},
  };
  for (StabilityCase& one : limit_cases()) cases.push_back(std::move(one));
  return cases;
}

}  // namespace subworld
