// The smallest engine (deploy/examples), loaded like any engine from outside, and the loader's messages
// for invalid files.
#include "model/error.hpp"
#include "physics/plugin.hpp"
#include "support/engines.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>

namespace subworld {
namespace {

namespace fs = std::filesystem;
using test::at;
using test::floor_plane;
using test::kFloor;
using test::kG;
using test::kOther;
using test::totals;

constexpr BodyId kBall{1};
constexpr double kBallRadius = 0.05, kBallMass = 0.2, kStep = 0.001;

/// Sets SUBWORLD_ENGINES during its lifetime.
class EngineFolders {
 public:
  explicit EngineFolders(const std::string& folders) { setenv("SUBWORLD_ENGINES", folders.c_str(), 1); }
  ~EngineFolders() { unsetenv("SUBWORLD_ENGINES"); }
  EngineFolders(const EngineFolders&) = delete;
  EngineFolders& operator=(const EngineFolders&) = delete;
};

Body ball(BodyId id, double friction = 0.5, double restitution = 0.0) {
  Body body = test::ball_proxy(id, kBallRadius, kBallMass);
  body.gravity = body.rotates = true;
  body.material = {friction, restitution};
  return body;
}

BodyState moving(const BodyState& place, const Vec3& velocity) {
  BodyState state = place;
  state.linear_velocity = velocity;
  return state;
}

std::string error_of(const EngineSettings& settings) {
  try {
    (void)make_engine(settings, {});
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ExitCode::usage);
    return e.what();
  }
  ADD_FAILURE() << "no error";
  return {};
}

std::string error_of(const std::string& engine) { return error_of(test::Tested{engine, "fast"}.settings()); }

void expect_says(const std::string& text, std::initializer_list<std::string> parts) {
  for (const std::string& part : parts) EXPECT_NE(text.find(part), std::string::npos) << part << " is not in: " << text;
}

class ExampleEngine : public testing::Test {
 protected:
  ExampleEngine() : engine(make()) {}
  std::unique_ptr<Engine> make() const {
    auto made = make_engine(test::Tested{"spheres", "fast"}.settings(), {});
    Body floor = floor_plane(kFloor);
    floor.material = {0.5, 1.0};
    made->add(floor, BodyState{});
    return made;
  }
  void run(double seconds) { test::run(*engine, static_cast<int>(std::lround(seconds / kStep)), kStep); }

  EngineFolders folders{EXAMPLE_ENGINES_FOLDER};
  std::unique_ptr<Engine> engine;
};

TEST_F(ExampleEngine, IsFoundByItsFolder) {
  EXPECT_EQ(engine->name(), "spheres");
  EXPECT_EQ(engine_plugin("spheres").name, "spheres");
  const auto names = engine_names();
  EXPECT_TRUE(std::ranges::count(names, "spheres"));
  EXPECT_TRUE(std::ranges::count(names, "bullet")) << "those beside the program are still there";
}

TEST_F(ExampleEngine, ARestingSphereIsHeldByItsWeight) {
  engine->add(ball(kBall), at(0, 0, kBallRadius));
  run(0.5);
  EXPECT_NEAR(totals(*engine, kBall).normal, kBallMass * kG * kStep, 1e-12);
  EXPECT_LT(totals(*engine, kBall).tangential.norm(), 1e-12);
  EXPECT_NEAR(engine->state(kBall).position.z(), kBallRadius, 1e-9);
}

TEST_F(ExampleEngine, AFallingSphereFallsAndLandsWithItsMomentum) {
  engine->add(ball(kBall), at(0, 0, 1.0));
  run(0.3);
  EXPECT_NEAR(engine->state(kBall).linear_velocity.z(), -kG * 0.3, 1e-9);
  double impulse = 0.0;
  for (int i = 0; i < 400; ++i) {
    engine->step(kStep);
    impulse += totals(*engine, kBall).normal;
  }
  EXPECT_NEAR(impulse, kBallMass * kG * 0.7, 1e-6) << "all momentum that gravity gave went into the floor";
  EXPECT_NEAR(engine->state(kBall).position.z(), kBallRadius, 1e-5);
}

TEST_F(ExampleEngine, ASphereSlidesByMuNAndRollsAtFiveSeventhsOfItsSpeed) {
  const Vec3 v0 = 2.0 * Vec3(3, 4, 0).normalized();
  engine->add(ball(kBall), moving(at(0, 0, kBallRadius), v0));
  run(0.05);
  EXPECT_NEAR(totals(*engine, kBall).normal, kBallMass * kG * kStep, 1e-9);
  EXPECT_NEAR(totals(*engine, kBall).tangential.norm(), 0.5 * kBallMass * kG * kStep, 1e-9);
  EXPECT_LT((engine->state(kBall).linear_velocity - v0 * (1.0 - 0.5 * kG * 0.05 / v0.norm())).norm(), 1e-6);
  // Sliding ends at t = 2 v0 / (7 mu g) with v = 5/7 v0 (solid sphere, I = 2/5 m r^2), here after 0.117 s.
  run(1.0);
  const BodyState rolls = engine->state(kBall);
  EXPECT_LT((rolls.linear_velocity - 5.0 / 7.0 * v0).norm(), 1e-6);
  EXPECT_LT((rolls.angular_velocity - Vec3::UnitZ().cross(rolls.linear_velocity) / kBallRadius).norm(), 1e-5);
  EXPECT_LT(totals(*engine, kBall).tangential.norm(), 1e-9) << "rolling needs no friction";
}

TEST_F(ExampleEngine, EqualSpheresExchangeTheirVelocities) {
  Body one = ball(kBall, 0.5, 1.0), two = ball(kOther, 0.5, 1.0);
  one.gravity = two.gravity = false;
  engine->add(one, moving(at(0, 0, 5), {1.5, 0, 0}));
  engine->add(two, moving(at(0.3, 0, 5), {-0.5, 0, 0}));
  run(0.5);
  EXPECT_LT((engine->state(kBall).linear_velocity - Vec3(-0.5, 0, 0)).norm(), 1e-9);
  EXPECT_LT((engine->state(kOther).linear_velocity - Vec3(1.5, 0, 0)).norm(), 1e-9);
}

TEST_F(ExampleEngine, AnObliqueHitKeepsMomentum) {
  Body one = ball(kBall, 0.5, 0.5), two = ball(kOther, 0.5, 0.5);
  one.gravity = two.gravity = false;
  engine->add(one, moving(at(0, 0, 5), {1.5, 0, 0.2}));
  engine->add(two, moving(at(0.3, 0.04, 5), {-0.5, 0.1, 0}));
  const auto momentum = [&] {
    Vec3 linear = Vec3::Zero();
    for (const BodyId id : {kBall, kOther}) linear += kBallMass * engine->state(id).linear_velocity;
    return linear;
  };
  const Vec3 before = momentum();
  run(0.5);
  ASSERT_GT((engine->state(kBall).linear_velocity - Vec3(1.5, 0, 0.2)).norm(), 0.1) << "they missed";
  EXPECT_GT(engine->state(kBall).angular_velocity.norm(), 1.0);
  EXPECT_LT((momentum() - before).norm(), 1e-12);
}

TEST_F(ExampleEngine, ACheckpointContinuesBitByBit) {
  std::vector<BodyId> ids;
  for (std::uint32_t i = 1; i < 12; ++i) {
    ids.push_back(BodyId{i});
    engine->add(ball(BodyId{i}, 0.5, 0.3), at(0.03 * (i % 3), 0.02 * (i % 2), 0.06 + 0.09 * i));
  }
  run(0.3);
  engine->apply_force(ids[0], {0, 3, 0}, {0.01, 0, 0});
  const Checkpoint saved = engine->checkpoint();
  run(0.4);
  const std::vector<double> first = test::bits(*engine, ids);
  engine->apply_impulse(ids[1], {1, 2, 3}, Vec3::Zero());
  engine->apply_force(ids[2], {5, 0, 0}, Vec3::Zero());
  engine->restore(saved);
  run(0.4);
  EXPECT_EQ(test::bits(*engine, ids), first);
}

TEST_F(ExampleEngine, ACheckpointOfOtherBodiesIsRefusedAndChangesNothing) {
  engine->add(ball(kBall), at(0, 0, 1));
  const Checkpoint saved = engine->checkpoint();
  engine->remove(kBall);
  EXPECT_THROW(engine->restore(saved), Error);
  ASSERT_TRUE(engine->set_state(kFloor, at(0, 0, -3)));
  engine->add(ball(kOther), at(0, 0, 2));
  EXPECT_THROW(engine->restore(saved), Error) << "as many bodies, but others";
  EXPECT_EQ(engine->state(kFloor).position.z(), -3.0);
  EXPECT_THROW(engine->restore(Checkpoint{}), Error);
}

TEST_F(ExampleEngine, GhostsMeetMovableBodiesOnly) {
  engine->add(ball(kBall), at(0, 0, kBallRadius));
  engine->add(ball(kOther), at(0, 0, 0.2), Role::ghost);     // falls onto the ball
  engine->add(ball(BodyId{3}), at(1, 0, 0.1), Role::ghost);  // falls through the floor
  Body still = ball(BodyId{4});
  still.gravity = false;
  engine->add(still, at(2, 0, 0.2), Role::ghost);  // the next one falls through it
  engine->add(ball(BodyId{5}), at(2, 0, 0.4), Role::ghost);
  run(0.3);
  EXPECT_GT(engine->state(kOther).position.z(), 0.14);
  EXPECT_LT(engine->state(BodyId{3}).position.z(), -0.2);
  EXPECT_EQ(engine->state(BodyId{4}).position, Vec3(2, 0, 0.2));
  EXPECT_LT(engine->state(BodyId{5}).position.z(), 0.0);
}

TEST_F(ExampleEngine, RefusesWhatIsNotFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  engine->add(ball(kBall), at(0, 0, 1));
  EXPECT_FALSE(engine->set_state(kBall, at(nan, 0, 0)));
  EXPECT_FALSE(engine->set_velocity(kBall, {0, nan, 0}, Vec3::Zero()));
  EXPECT_FALSE(engine->apply_impulse(kBall, {0, nan, 0}, Vec3::Zero()));
  EXPECT_FALSE(engine->apply_force(kBall, Vec3::Zero(), {0, 0, INFINITY}));
  EXPECT_EQ(engine->state(kBall).position, Vec3(0, 0, 1));
  EXPECT_THROW(engine->add(ball(kOther), at(0, nan, 0)), Error);
  EXPECT_FALSE(engine->contains(kOther));
  engine->step(kStep);
  EXPECT_TRUE(finite(engine->state(kBall)));
}

TEST_F(ExampleEngine, ABoxIsAnErrorThatNamesTheCure) {
  try {
    engine->add(test::cube(kOther), at(0, 0, 1));
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ExitCode::usage);
    expect_says(e.what(), {"spheres", "body 2", "choose another engine"});
  }
  EXPECT_FALSE(engine->contains(kOther));
}

TEST_F(ExampleEngine, AnUnknownPresetNamesThoseThereAre) {
  expect_says(error_of(test::Tested{"spheres", "best"}.settings()), {"best", "fast", "quality"});
}

TEST_F(ExampleEngine, WorksInAnotherUnitOfLength) {
  EngineSettings settings = test::Tested{"spheres", "fast"}.settings();
  settings.length_unit_m = 0.01;
  engine = make_engine(settings, {});
  engine->add(floor_plane(kFloor), BodyState{});
  engine->add(ball(kBall), moving(at(0, 0, kBallRadius), {2, 0, 0}));
  run(1.0);
  EXPECT_NEAR(engine->state(kBall).linear_velocity.x(), 10.0 / 7.0, 1e-6);
  EXPECT_NEAR(totals(*engine, kBall).normal, kBallMass * kG * kStep, 1e-9);
}

// --- the loader ---

class EngineLoader : public testing::Test {
 protected:
  EngineLoader() { fs::create_directories(folder); }
  ~EngineLoader() override { fs::remove_all(folder); }
  const fs::path folder = fs::temp_directory_path() / ("subworld-engines-" + std::to_string(getpid()));
};

TEST_F(EngineLoader, AFileThatIsNoLibraryIsNamedWithTheCure) {
  const fs::path file = folder / "libsubworld_engine_x.so";
  std::ofstream(file) << "this is no library\n";
  const EngineFolders here(folder.string());
  expect_says(error_of("x"), {"\"x\"", file.string(), "deploy/build"});
}

TEST_F(EngineLoader, ALibraryThatExportsNoEngineIsNamedWithTheCure) {
  const EngineFolders here(BROKEN_ENGINES_FOLDER);
  expect_says(error_of("broken"), {std::string(BROKEN_ENGINES_FOLDER) + "/libsubworld_engine_broken.so",
                                   "subworld_engine_plugin", "common/physics/README.md"});
}

TEST_F(EngineLoader, ALibraryOfAnotherBuildIsNamedWithTheCure) {
  const EngineFolders here(BROKEN_ENGINES_FOLDER);
  expect_says(error_of("old"), {std::string(BROKEN_ENGINES_FOLDER) + "/libsubworld_engine_old.so",
                                "interface " + std::to_string(kEnginePluginInterface - 1), "build both together"});
}

TEST_F(EngineLoader, TheFoldersOfTheVariableWinInTheirOrder) {
  // Another engine with the name of one in the program's folder.
  fs::create_symlink(fs::path(EXAMPLE_ENGINES_FOLDER) / "libsubworld_engine_spheres.so",
                     folder / "libsubworld_engine_ode.so");
  const EngineFolders here("/no/such/folder:" + folder.string() + "::" + BROKEN_ENGINES_FOLDER);
  EXPECT_EQ(make_engine(test::Tested{"ode", "fast"}.settings(), {})->name(), "spheres");
}

TEST_F(EngineLoader, AnEngineThatIsNotBuiltSaysHowToGetIt) {
  for (const std::string engine : {"havok", "physx", "rapier"}) {
    const auto names = engine_names();
    if (std::ranges::count(names, engine)) continue;
    expect_says(error_of(engine), {engine, "not in this build", "SUBWORLD_ENGINES_ALL=1 deploy/build"});
  }
  expect_says(error_of("havoc"), {"havoc", "bullet", "bullet_float", "ode"});
}

}  // namespace
}  // namespace subworld
