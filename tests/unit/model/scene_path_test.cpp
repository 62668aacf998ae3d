#include "model/scene/scene.hpp"
#include "model/trigonometry.hpp"
#include "support/scene_text.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace subworld {
namespace {

using Path = std::vector<PathSegment>;

Path path_of(const std::string& scene) {
  return load_scene(std::string(SCENES_FOLDER) + "/" + scene + ".yaml").users.front().device.path;
}

PathSegment turn(const Vec3& axis, double angle, double from_s, double to_s) {
  PathSegment s;
  s.kind = PathSegment::Kind::turn;
  s.axis = axis;
  s.angle = angle;
  s.from_s = from_s;
  s.to_s = to_s;
  return s;
}

/// Velocities are the derivatives of positions and orientations, by central differences away from the corners.
void expect_velocity_is_derivative(const Path& path, double until_s) {
  constexpr double kStep = 1e-6;
  for (double t = 0.0137; t < until_s; t += 0.0511) {
    const PathPoint before = evaluate(path, t - kStep);
    const PathPoint at = evaluate(path, t);
    const PathPoint after = evaluate(path, t + kStep);
    const Vec3 velocity = (after.offset.position - before.offset.position) / (2.0 * kStep);
    const Quat turned = after.offset.orientation * before.offset.orientation.conjugate();
    const Vec3 rate = 2.0 * turned.vec() / (2.0 * kStep);
    EXPECT_LT((velocity - at.linear_velocity).norm(), 1e-6) << "t = " << t;
    EXPECT_LT((rate - at.angular_velocity).norm(), 1e-6) << "t = " << t;
  }
}

TEST(Path, RowGoesForthAndBack) {
  const Path path = path_of("row");
  const auto x = [&](double t) { return evaluate(path, t).offset.position.x(); };
  EXPECT_DOUBLE_EQ(x(0.0), 0.0);
  EXPECT_DOUBLE_EQ(x(0.2), 0.0);
  EXPECT_NEAR(x(1.2), 0.06, 1e-15);
  EXPECT_DOUBLE_EQ(x(2.3), 0.12);
  EXPECT_NEAR(x(3.0), 0.02, 1e-15);
  EXPECT_NEAR(evaluate(path, 1.0).linear_velocity.x(), 0.06, 1e-15);
  EXPECT_NEAR(evaluate(path, 2.7).linear_velocity.x(), -0.25, 1e-15);
  EXPECT_EQ(evaluate(path, 2.9).linear_velocity.x(), 0.0);
}

TEST(Path, WithTheLeastJerkItBeginsAndEndsAtRest) {
  Path path{{.from_s = 0.2, .to_s = 1.2, .displacement = {0.1, 0, 0}}, turn({0, 0, 1}, 1.0, 0.5, 1.5)};
  for (PathSegment& segment : path) segment.profile = Profile::minimum_jerk;
  expect_velocity_is_derivative(path, 2.0);
  EXPECT_NEAR(evaluate(path, 0.7).offset.position.x(), 0.05, 1e-15);
  EXPECT_NEAR(evaluate(path, 0.7).linear_velocity.x(), 1.875 * 0.1, 1e-12) << "Flash and Hogan 1985";
  EXPECT_LT(evaluate(path, 0.201).linear_velocity.x(), 1e-5);
  EXPECT_NEAR(evaluate(path, 3.0).offset.position.x(), 0.1, 1e-15);
  for (PathSegment& segment : path) segment.profile.reset();
  EXPECT_EQ(evaluate(path, 0.4).linear_velocity.x(), 0.1) << "constant where nothing says otherwise";
  EXPECT_LT(evaluate(path, 0.3, Profile::minimum_jerk).linear_velocity.x(), 0.1);
}

TEST(Path, HeapDigsAgainAndAgainElsewhere) {
  const Path path = path_of("heap");
  for (int dig = 0; dig < 16; ++dig) {
    const auto at = [&](double t) { return evaluate(path, 4.0 * dig + t).offset.position; };
    EXPECT_NEAR(at(1.75).z() - at(0.15).z(), -0.22, 0.01) << "dig " << dig;
    EXPECT_NEAR(at(3.35).z() - at(1.75).z(), 0.22, 0.01) << "withdrawn";
    EXPECT_NEAR(evaluate(path, 4.0 * dig + 1.0).linear_velocity.z(), 0.0, 0.01)
        << "the device rests at the touched place";
    EXPECT_GT((at(1.75) - at(5.75)).norm(), 0.05) << "the next dig is elsewhere";
  }
}

TEST(Path, ScatterRidesASine) {
  const Path path = path_of("scatter");
  for (double t = 0.0; t < 2.5; t += 0.1) {
    const Vec3 at = evaluate(path, t).offset.position;
    EXPECT_NEAR(at.y(), 0.15 * std::sin(4.0 * at.x()), 1e-12);
  }
  EXPECT_NEAR(evaluate(path, 2.4).offset.position.x(), 1.0, 1e-15);
}

TEST(Path, VelocityIsTheDerivative) {
  for (const char* scene : {"row", "press", "scatter", "heap", "lift", "tower_inside", "tower_base", "example"}) {
    SCOPED_TRACE(scene);
    expect_velocity_is_derivative(path_of(scene), 3.0);
  }
}

TEST(Path, TurnsAboutDifferentAxesCompose) {
  const Path path{turn(Vec3::UnitX(), 1.0, 0.0, 2.0), turn(Vec3::UnitZ(), 2.0, 0.5, 1.0),
                  turn(Vec3(1, 2, 2) / 3.0, -1.5, 0.7, 2.5)};
  expect_velocity_is_derivative(path, 3.0);
}

PathSegment move(const Vec3& by, double from_s, double to_s, double every_s) {
  PathSegment s;
  s.displacement = by;
  s.from_s = from_s;
  s.to_s = to_s;
  s.every_s = every_s;
  return s;
}

TEST(Path, MovesThatLeadBackRepeatForEver) {
  const Path path{move({0.1, 0, 0}, 0.5, 1.0, 2.0), move({-0.1, 0, 0}, 1.5, 2.0, 2.0)};
  for (double t = 0.0; t < 2.4; t += 0.01) {
    const PathPoint first = evaluate(path, t);
    const PathPoint later = evaluate(path, t + 60.0);
    EXPECT_LT((first.offset.position - later.offset.position).norm(), 1e-12) << "t = " << t;
  }
  EXPECT_NEAR(evaluate(path, 61.2).offset.position.x(), 0.1, 1e-12);
  EXPECT_NEAR(evaluate(path, 60.3).offset.position.x(), 0.0, 1e-12);
  expect_velocity_is_derivative(path, 7.0);
}

TEST(Path, ARepetitionIsAddedToTheLast) {
  const Path path{move({0, 0, 0.1}, 1.0, 1.5, 1.0), turn(Vec3::UnitX(), 0.2, 0.0, 1.0)};
  EXPECT_NEAR(evaluate(path, 3.6).offset.position.z(), 0.3, 1e-12);
  EXPECT_NEAR(evaluate(path, 3.25).offset.position.z(), 0.25, 1e-12);
  EXPECT_NEAR(evaluate(path, 3.6).offset.orientation.angularDistance(Quat::Identity()), 0.2, 1e-12) << "once";
}

TEST(Path, CircleStopsAtItsEnd) {
  PathSegment circle;
  circle.kind = PathSegment::Kind::circle;
  circle.radius = 0.1;
  circle.period_s = 1.0;
  circle.axis = Vec3(0, 1, 0);
  circle.to_s = 0.5;
  const PathPoint end = evaluate({circle}, 2.0);
  EXPECT_LT((end.offset.position - Vec3(-0.2, 0, 0)).norm(), 1e-12);
  EXPECT_EQ(end.linear_velocity.norm(), 0.0);
  expect_velocity_is_derivative({circle}, 1.0);
}

TEST(Trigonometry, AgreesWithTheLibraryAndIsExactAtQuarters) {
  for (double degrees = -1000.0; degrees < 1000.0; degrees += 0.37) {
    const SinCos at = sin_cos_deg(degrees);
    const double turn = std::remainder(degrees, 360.0) * M_PI / 180.0;
    EXPECT_NEAR(at.sin, std::sin(turn), 1e-15);
    EXPECT_NEAR(at.cos, std::cos(turn), 1e-15);
  }
  EXPECT_EQ(sin_cos_deg(90.0).cos, 0.0);
  EXPECT_EQ(sin_cos_deg(-90.0).sin, -1.0);
  EXPECT_EQ(sin_cos_deg(180.0).sin, 0.0);
  EXPECT_EQ(sin_cos_deg(720.0).cos, 1.0);
}

}  // namespace
}  // namespace subworld
