// The basis of the stability lab: its searches, its formulas, and the completeness of its tables.
#include "io/results/json.hpp"
#include "lab/page/tables.hpp"
#include "lab/stability/bed.hpp"
#include "lab/stability/cases/cases.hpp"
#include "lab/stability/formulas.hpp"
#include "lab/stability/run.hpp"
#include "model/error.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <set>

namespace subworld {
namespace {

TEST(LimitSearch, EnclosesALimitInBothDirections) {
  const Bracket up =
      find_limit({.from = 1.0, .to = 1e6, .stride = 10.0, .precision = 1.1}, [](double x) { return x < 777.0; });
  EXPECT_LT(up.held, 777.0);
  EXPECT_GE(up.failed, 777.0);
  EXPECT_LE(up.failed / up.held, 1.1);
  EXPECT_NEAR(up.middle(), 777.0, 0.1 * 777.0);
  EXPECT_EQ(up.proven(), up.held);
  const Bracket down =
      find_limit({.from = 100.0, .to = 0.1, .stride = 2.0, .precision = 1.01}, [](double x) { return x > 3.0; });
  EXPECT_TRUE(down.inside());
  EXPECT_GT(down.held, 3.0);
  EXPECT_LE(down.failed, 3.0);
  EXPECT_LE(down.held / down.failed, 1.01);
}

TEST(LimitSearch, SaysWhereThereIsNoLimitToEnclose) {
  int tried = 0;
  const Bracket none = find_limit({.from = 2.0, .to = 8.0}, [&](double) { return ++tried > 5; });
  EXPECT_FALSE(none.inside());
  EXPECT_EQ(tried, 1) << "from the first value on nothing holds";
  EXPECT_TRUE(std::isnan(none.held));
  EXPECT_EQ(none.proven(), 2.0);
  const Bracket all = find_limit({.from = 2.0, .to = 9.0}, [](double) { return true; });
  EXPECT_FALSE(all.inside());
  EXPECT_EQ(all.held, 9.0) << "the end of the range is tried";
  EXPECT_TRUE(std::isnan(all.failed));
}

// A solver may fail at one value and hold again at larger ones: the limit is the first failure.
TEST(LimitSearch, FindsTheNearestOfSeveralLimits) {
  const auto holds = [](double x) { return x < 5.0 || x > 50.0; };
  const Bracket bracket = find_limit({.from = 1.0, .to = 1000.0, .stride = 3.0, .precision = 1.05}, holds);
  EXPECT_NEAR(bracket.middle(), 5.0, 0.3);
}

TEST(LimitSearch, RefusesWhatCannotEnd) {
  const auto holds = [](double) { return true; };
  EXPECT_THROW((void)find_limit({.from = 0.0, .to = 1.0}, holds), std::invalid_argument);
  EXPECT_THROW((void)find_limit({.from = 1.0, .to = 2.0, .stride = 1.0}, holds), std::invalid_argument);
}

TEST(StabilityFormulas, AgreeWithTheBooks) {
  EXPECT_NEAR(slide_distance_m(1.0, 0.5), 0.10194, 1e-5);
  const SlideToRoll ball = slide_to_roll(1.0, 0.4, 0.5), cylinder = slide_to_roll(1.0, 0.5, 0.5);
  EXPECT_NEAR(ball.speed_m_s, 5.0 / 7.0, 1e-12);
  EXPECT_NEAR(ball.sliding_m, 12.0 / (49.0 * 0.5 * kG), 1e-12);
  EXPECT_NEAR(cylinder.speed_m_s, 2.0 / 3.0, 1e-12);
  EXPECT_NEAR(cylinder.sliding_m, 5.0 / (18.0 * 0.5 * kG), 1e-12);
  EXPECT_NEAR(ball.place_m(ball.sliding_s + 1.0), ball.sliding_m + 5.0 / 7.0, 1e-12);
  EXPECT_NEAR(slip_angle_deg(1.0), 45.0, 1e-12);
  EXPECT_NEAR(tip_angle_deg(1.0), 45.0, 1e-12);
  EXPECT_NEAR(groove_force_n(10.0, 90.0), 5.0, 1e-12) << "a flat groove shares the weight";
  EXPECT_NEAR(groove_height_m(0.05, 30.0), 0.1, 1e-12);
  EXPECT_NEAR(disc_spin_s(40.0, 0.05, 0.5), 0.30581, 1e-5);
}

TEST(StabilityFormulas, EulersEquationsKeepMomentumAndEnergy) {
  const Vec3 inertia(0.0045, 0.0035, 0.0014);
  const FreeBody start{.rate_rad_s = Vec3(0.1, 10.0, 0.1)};
  const FreeBody end = turned_by_euler(inertia, start, 5.0);
  const auto momentum = [&](const FreeBody& b) { return Vec3(b.orientation * inertia.cwiseProduct(b.rate_rad_s)); };
  EXPECT_LT((momentum(end) - momentum(start)).norm(), 1e-9 * momentum(start).norm());
  EXPECT_NEAR(end.rate_rad_s.dot(inertia.cwiseProduct(end.rate_rad_s)),
              start.rate_rad_s.dot(inertia.cwiseProduct(start.rate_rad_s)), 1e-9);
}

/// The elliptic integral against the equations: after a period the body-frame rate is the initial one.
TEST(StabilityFormulas, TumblePeriodIsThatOfEulersEquations) {
  for (const Vec3& rate : {Vec3(0.1, 10.0, 0.1), Vec3(0.1, 10.0, 0.02), Vec3(3.0, 4.0, 5.0), Vec3(5.0, 1.0, 0.5)}) {
    SCOPED_TRACE(rate.transpose());
    const Vec3 inertia(0.0045, 0.0035, 0.0014);
    const double period_s = tumble_period_s(inertia, rate);
    const FreeBody start{.rate_rad_s = rate};
    EXPECT_LT((turned_by_euler(inertia, start, period_s).rate_rad_s - rate).norm(), 1e-5 * rate.norm());
    EXPECT_GT((turned_by_euler(inertia, start, 0.45 * period_s).rate_rad_s - rate).norm(), 0.05 * rate.norm());
  }
}

TEST(StabilityFormulas, AFastTopPrecessesByItsWeightOverItsSpin) {
  EXPECT_NEAR(precession_rad_s(0.06, 3e-4, 2e-4, 1e4, 0.3), 0.06 / (2e-4 * 1e4), 1e-4);
  EXPECT_NEAR(precession_rad_s(0.06, 3e-4, 2e-4, 50.0, 0.5 * kPi), 0.06 / (2e-4 * 50.0), 1e-9) << "exact where level";
  EXPECT_TRUE(std::isnan(precession_rad_s(0.06, 3e-4, 2e-4, 5.0, 0.3))) << "too slow to precess";
}

TEST(StabilityErrors, AreCountedAsTheCaseSays) {
  EXPECT_NEAR(error_of(Compare::relative, 0.98, 1.0), 0.02, 1e-12);
  EXPECT_NEAR(error_of(Compare::relative, -0.98, -1.0), 0.02, 1e-12);
  EXPECT_EQ(error_of(Compare::absolute, -3.0, 0.0), 3.0);
  EXPECT_EQ(error_of(Compare::at_least, 50.0, 100.0), 2.0);
  EXPECT_EQ(error_of(Compare::at_most, 50.0, 100.0), 0.5);
}

StabilityCase made_up(std::function<Measurement(const EngineSetting&, double)> measure) {
  StabilityCase one;
  one.name = "made_up";
  one.quantity = "size";
  one.tolerance = 0.1;
  one.expected = [](double) { return 10.0; };
  one.measure = std::move(measure);
  return one;
}

TEST(StabilityRow, HoldsTheMarginAndTheVerdict) {
  const StabilityCase one = made_up([](const EngineSetting&, double) { return Measurement{10.5}; });
  const Json row = *measured_row({&one, {}, std::nullopt});
  EXPECT_EQ(row.at("pass"), true);
  EXPECT_NEAR(margin_of(row), 0.5, 1e-9);
  EXPECT_EQ(measured_text(row), "10.5");
  const StabilityCase far = made_up([](const EngineSetting&, double) { return Measurement{13.0}; });
  EXPECT_EQ(measured_row({&far, {}, std::nullopt})->at("pass"), false);
}

TEST(StabilityRow, AnEngineThatFailsDoesNotPass) {
  const StabilityCase thrown =
      made_up([](const EngineSetting&, double) -> Measurement { throw std::runtime_error("it broke"); });
  const StabilityCase nowhere = made_up([](const EngineSetting&, double) { return Measurement{std::nan("")}; });
  for (const StabilityCase* one : {&thrown, &nowhere}) {
    const Json row = *measured_row({one, {}, std::nullopt});
    EXPECT_EQ(row.at("pass"), false);
    EXPECT_EQ(row.at("measured"), nullptr);
    EXPECT_TRUE(std::isinf(margin_of(row)));
    EXPECT_NE(row.at("failure"), "");
    EXPECT_EQ(measured_text(row), "failed");
  }
}

TEST(StabilityRow, MarksALimitOutsideOfTheSearch) {
  const auto text = [](double limit, bool upwards) {
    const StabilityCase one = made_up([=](const EngineSetting&, double) {
      const Search search{.from = upwards ? 1.0 : 100.0, .to = upwards ? 100.0 : 1.0};
      return limit_proven(find_limit(search, [=](double x) { return upwards ? x < limit : x > limit; }));
    });
    return measured_text(*measured_row({&one, {}, std::nullopt}));
  };
  EXPECT_EQ(text(1e3, true), ">=100");
  EXPECT_EQ(text(0.5, true), "<1");
  EXPECT_EQ(text(0.5, false), "<=1");
  EXPECT_EQ(text(1e3, false), ">100");
}

TEST(StabilityTables, AreComplete) {
  std::set<std::string> names, groups;
  for (const StabilityCase& one : stability_cases()) {
    SCOPED_TRACE(one.name);
    EXPECT_TRUE(names.insert(one.name).second) << "twice";
    groups.insert(one.group);
    for (const std::string* text : {&one.shows, &one.group, &one.quantity, &one.formula, &one.source, &one.why})
      EXPECT_FALSE(text->empty());
    EXPECT_GT(one.tolerance, 0.0);
    EXPECT_EQ(one.values.empty(), one.parameter.empty());
    ASSERT_TRUE(one.expected && one.measure);
    for (const double value : one.values) {
      EXPECT_TRUE(std::isfinite(one.expected(value)));
      EXPECT_TRUE(one.compare != Compare::relative || one.expected(value) != 0.0) << "no error relative to nothing";
    }
  }
  for (const std::string& group : groups) EXPECT_FALSE(names.contains(group)) << group;
}

TEST(StabilityPlan, ChoosesByCaseAndGroupAndNamesTheNearest) {
  const auto chosen = chosen_cases({"bouncing", "slip_angle"});
  EXPECT_EQ(chosen.size(), bouncing_cases().size() + 1);
  EXPECT_EQ(chosen_cases({}).size(), stability_cases().size());
  try {
    (void)chosen_cases({"slip_angel"});
    FAIL();
  } catch (const Error& wrong) {
    EXPECT_EQ(wrong.code(), ExitCode::usage);
    EXPECT_NE(std::string(wrong.what()).find("did you mean \"slip_angle\""), std::string::npos) << wrong.what();
  }
}

TEST(StabilityPlan, QuickMeasuresLessAndStepsOfItsOwnOnce) {
  StabilityRequest request{.names = {}, .engines = {"bullet"}, .presets = {"fast"}, .steps_s = {}, .quick = false};
  const auto whole = points_of(request);
  request.quick = true;
  const auto quick = points_of(request);
  EXPECT_LT(2 * quick.size(), whole.size());
  std::set<double> steps;
  for (const StabilityPoint& point : whole) steps.insert(point.setting.dt_s);
  EXPECT_EQ(steps.size(), 3U);
  std::map<const StabilityCase*, std::set<double>> steps_of;
  for (const StabilityPoint& point : whole) steps_of[point.one].insert(point.setting.dt_s);
  for (const StabilityCase& one : stability_cases()) {
    EXPECT_EQ(steps_of[&one].size(), one.own_step || one.once ? 1U : 3U) << one.name;
  }
}

TEST(StabilityPlan, ACaseWithoutEngineIsMeasuredOnce) {
  const auto whole =
      points_of({.names = {}, .engines = {"bullet", "ode"}, .presets = {}, .steps_s = {}, .quick = false});
  std::map<const StabilityCase*, std::set<std::string>> engines_of;
  for (const StabilityPoint& point : whole) engines_of[point.one].insert(point.setting.engine);
  for (const StabilityCase& one : stability_cases()) EXPECT_EQ(engines_of[&one].size(), one.once ? 1U : 2U) << one.name;
}

// A body in free fall has constant energy for any step: the bed adds no error of its own.
TEST(StabilityBed, FreeFallKeepsTheEnergy) {
  for (const char* preset : {"fast", "quality"}) {
    TestBed bed({"bullet", preset, 1.0 / 60.0});
    bed.add(ball_body(0.05, 2.0), Vec3(0, 0, 10));
    const double start_j = bed.energy_j();
    bed.run(1.0, [&] {
      EXPECT_NEAR(bed.energy_j(), start_j, 1e-9 * start_j);
      return true;
    });
    EXPECT_NEAR(bed.moved_m(), 0.5 * kG, 0.1);
  }
}

}  // namespace
}  // namespace subworld
