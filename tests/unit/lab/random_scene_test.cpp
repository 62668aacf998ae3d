// Random scenes: their coverage, the round trip through text, and detection and shrinking of an injected fault.
#include "io/results/json.hpp"
#include "lab/random/energy_book.hpp"
#include "lab/random/judge.hpp"
#include "lab/random/run.hpp"
#include "lab/random/scene.hpp"
#include "lab/random/scene_text.hpp"
#include "lab/random/shrink.hpp"
#include "lab/random/structures.hpp"
#include "lab/session/apart.hpp"
#include "model/error.hpp"
#include "model/settings/agreed_settings.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <set>

#include <unistd.h>

namespace subworld {
namespace {

class RandomScenes : public ::testing::Test {
 protected:
  ~RandomScenes() override { std::filesystem::remove_all(folder_); }
  const std::string folder_ = testing::TempDir() + "random_scene_test." + std::to_string(getpid());
};

TEST_F(RandomScenes, AreTheSameForTheSameSeed) {
  for (std::uint64_t i = 0; i < 20; ++i) {
    EXPECT_EQ(scene_text(random_scene(7, i)), scene_text(random_scene(7, i)));
    EXPECT_NE(scene_text(random_scene(7, i)), scene_text(random_scene(8, i)));
    EXPECT_NE(settings_hash(random_scene(7, i)), settings_hash(random_scene(7, i + 1)));
  }
}

/// The draws are recorded: another result here would invalidate all recorded seeds.
TEST_F(RandomScenes, DrawsAreThoseOfTheStandardsGenerator) {
  Draw draw(1, 2);
  const int first = draw.whole(0, 999'999), second = draw.whole(0, 999'999);
  Draw again(1, 2);
  EXPECT_EQ(again.whole(0, 999'999), first);
  EXPECT_EQ(again.whole(0, 999'999), second);
  EXPECT_NE(Draw(1, 3).whole(0, 999'999), first);
  EXPECT_EQ(rounded(0.123456), 0.123);
}

TEST_F(RandomScenes, CoverTheFormat) {
  std::set<ShapeKind> movable, fixed, tools;
  std::set<std::string> schemes;
  std::set<int> users, kinds, freedoms, structures;
  double heaviest = 0.0, lightest = INFINITY, largest = 0.0, smallest = INFINITY, friction = 0.0, restitution = 0.0;
  int ratio = 0, delayed = 0, operators = 0, moving = 0;
  double latest_s = 0.0;
  constexpr int kScenes = 400;
  for (std::uint64_t i = 0; i < kScenes; ++i) {
    const Scene scene = random_scene(3, i);
    EXPECT_GE(scene.bodies.size(), 2U);
    EXPECT_LE(scene.bodies.size(), 30U);
    for (const Body& body : scene.bodies) {
      (body.fixed() ? fixed : movable).insert(body.shape.kind);
      friction = std::max(friction, body.material.friction);
      restitution = std::max(restitution, body.material.restitution);
      if (body.fixed()) continue;
      heaviest = std::max(heaviest, body.mass);
      lightest = std::min(lightest, body.mass);
      const Box box = bounds_of(scene, body, {});
      largest = std::max(largest, (box.upper - box.lower).maxCoeff());
      smallest = std::min(smallest, (box.upper - box.lower).minCoeff());
      moving += !scene.initial[index(body.id)].linear_velocity.isZero(0.0);
    }
    for (const UserSpec& user : scene.users) {
      tools.insert(scene.body(user.proxy).shape.kind);
      kinds.insert(static_cast<int>(user.device.kind));
      freedoms.insert(user.device.degrees_of_freedom);
      operators += user.device.operator_model.has_value();
      EXPECT_FALSE(user.device.path.empty());
    }
    schemes.insert(scene.settings.scheme);
    users.insert(static_cast<int>(scene.users.size()));
    ratio = std::max(ratio, scene.settings.largest_ratio());
    delayed += scene.settings.delay.any();
    latest_s = std::max({latest_s, scene.settings.delay.up_s + scene.settings.delay.down_s,
                         scene.settings.delay.from_device_s + scene.settings.delay.to_device_s});
  }
  using enum ShapeKind;
  EXPECT_EQ(movable, (std::set{sphere, box, capsule, cylinder, convex}));
  EXPECT_EQ(fixed, (std::set{box, plane, mesh}));
  EXPECT_EQ(tools, movable);
  EXPECT_EQ(schemes, (std::set<std::string>{"direct", "paper", "reduced"}));
  EXPECT_EQ(users, (std::set{1, 2, 3}));
  EXPECT_EQ(kinds.size(), 2U);
  EXPECT_EQ(freedoms.size(), 2U);
  EXPECT_GT(heaviest / lightest, 5e3);
  EXPECT_LT(smallest, 0.008);
  EXPECT_GT(largest, 0.3);
  EXPECT_GT(friction, 1.3);
  EXPECT_EQ(restitution, 1.0);
  EXPECT_EQ(ratio, 20);
  EXPECT_GT(latest_s, 0.05);
  EXPECT_LE(latest_s, 0.1);
  for (const int some : {delayed, operators, moving}) EXPECT_GT(some, kScenes / 20);
}

TEST_F(RandomScenes, BeginWithoutDeepOverlap) {
  for (std::uint64_t i = 0; i < 200; ++i) {
    const Scene scene = random_scene(5, i);
    const Overlap overlap = deepest_overlap(scene);
    const Box a = bounds_of(scene, scene.body(overlap.b), {});
    EXPECT_LE(overlap.depth_m, 0.02 * (a.upper - a.lower).minCoeff())
        << i << ": " << scene.body(overlap.a).name << " and " << scene.body(overlap.b).name;
  }
}

TEST_F(RandomScenes, TextReadsBackToTheSameScene) {
  for (std::uint64_t i = 0; i < 60; ++i) {
    SCOPED_TRACE(i);
    const Scene scene = random_scene(11, i), read = as_written(scene, folder_);
    ASSERT_EQ(read.bodies.size(), scene.bodies.size());
    EXPECT_EQ(read.description, scene.description);
    EXPECT_EQ(read.settings.duration_s, scene.settings.duration_s);
    bool meshes = false;
    for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
      const Body &mine = scene.bodies[b], &theirs = read.bodies[b];
      const bool hull = mine.shape.kind == ShapeKind::convex;
      meshes = meshes || hull;
      EXPECT_EQ(theirs.name, mine.name);
      EXPECT_EQ(theirs.mass, mine.mass);
      EXPECT_LT((theirs.inertia - mine.inertia).norm(), (hull ? 1e-5 : 1e-15) * mine.inertia.norm() + 1e-300);
      EXPECT_LT((read.initial[b].position - scene.initial[b].position).norm(), hull ? 1e-7 : 1e-300);
      EXPECT_LT(read.initial[b].orientation.angularDistance(scene.initial[b].orientation), 1e-7);
    }
    // Rotations are written as axis and angle; all other data must be equal to the last bit.
    Scene turned = read;
    turned.initial = scene.initial;
    for (std::size_t u = 0; u < scene.users.size(); ++u) {
      for (std::size_t s = 0; s < scene.users[u].device.path.size(); ++s) {
        PathSegment& segment = turned.users[u].device.path[s];
        const PathSegment& was = scene.users[u].device.path[s];
        EXPECT_NEAR(segment.angle, was.angle, 1e-14);
        segment.angle = was.angle;
        for (Vec3 PathSegment::*axis : {&PathSegment::axis, &PathSegment::along, &PathSegment::across}) {
          EXPECT_LT((segment.*axis - was.*axis).norm(), 1e-15);
          segment.*axis = was.*axis;
        }
      }
    }
    if (!meshes && scene.meshes.empty()) {
      EXPECT_EQ(settings_hash(turned), settings_hash(scene));
    }
  }
}

/// Further features of the scenes in deploy/scenes: densities, repetitions, every form of path.
TEST_F(RandomScenes, TextHoldsTheScenesOfTheLibrary) {
  for (const char* name : {"example", "press", "row", "lift", "slope", "see_saw"}) {
    SCOPED_TRACE(name);
    Scene scene = load_scene(std::string(SCENES_FOLDER) + "/" + name + ".yaml");
    for (Body& body : scene.bodies) {  // the generator makes none of several parts
      if (body.shape.kind == ShapeKind::compound) body.shape = {.kind = ShapeKind::sphere, .radius = 0.1};
    }
    const Scene read = as_written(scene, folder_);
    ASSERT_EQ(read.bodies.size(), scene.bodies.size());
    for (std::size_t b = 0; b < scene.bodies.size(); ++b)
      EXPECT_LT((read.initial[b].position - scene.initial[b].position).norm(), 1e-7) << scene.bodies[b].name;
  }
}

/// An engine that accelerates moving bodies in each step; if the gain is not a number, the first body's state becomes
/// invalid.
class GainingEngine final : public EngineShell {
 public:
  GainingEngine(std::unique_ptr<Engine> inner, double gain) : inner_(std::move(inner)), gain_(gain) {}
  void add(const Body& body, const BodyState& state, Role role) override {
    inner_->add(body, state, role);
    if (!body.fixed()) ids_.push_back(body.id);
  }
  BodyState state(BodyId id) const override {
    BodyState s = inner_->state(id);
    if (std::isnan(gain_) && id == ids_.front() && steps_ > 100) s.position.x() = gain_;
    return s;
  }
  void stepped(double /*dt*/) override {
    ++steps_;
    for (const BodyId id : ids_) {
      const BodyState s = inner_->state(id);
      inner_->set_velocity(id, gain_ * s.linear_velocity, gain_ * s.angular_velocity);
    }
  }

 private:
  Engine& inner() const noexcept override { return *inner_; }
  std::unique_ptr<Engine> inner_;
  double gain_;
  int steps_ = 0;
  std::vector<BodyId> ids_;
};

EngineMaker gaining(double gain) {
  return [gain](const EngineSettings& settings, std::span<const Mesh> meshes) {
    return std::make_unique<GainingEngine>(make_engine(settings, meshes), gain);
  };
}

/// A ball that falls without contact, and a tool that a scripted device moves to and fro.
Scene falling() {
  Scene scene = random_scene(1, 0);
  scene.meshes.clear();
  scene.bodies.clear();
  scene.initial.clear();
  scene.users.resize(1);
  Draw draw(1);
  Builder builder(scene, draw, {});
  Body ball;
  ball.shape = {.kind = ShapeKind::sphere, .radius = 0.05};
  builder.set_mass(ball, 0.5);
  BodyState state;
  state.position.z() = 10.0;
  builder.add(ball, state, "ball");
  state.position.x() = 5.0;
  ball.gravity = false;
  ball.rotates = false;
  UserSpec& user = scene.users[0];
  user = {};
  user.name = "user0";
  user.own_proxy = true;
  user.proxy = builder.add(ball, state, "tool");
  scene.bodies.back().name = "user0/proxy";
  user.device.path = {{.from_s = 0.1, .to_s = 0.3, .displacement = Vec3(0.1, 0, 0)},
                      {.from_s = 0.4, .to_s = 0.6, .displacement = Vec3(-0.1, 0.05, 0)}};
  Settings plain;
  plain.settle_s = 0.0;
  plain.duration_s = 0.8;
  plain.users = 1;
  scene.settings = plain;
  return scene;
}

// The energy balance itself: a fall and the work of a coupling are explained to the last digits, for any scheme and
// step.
TEST_F(RandomScenes, BookExplainsFallAndWork) {
  for (const char* scheme : {"direct", "reduced", "paper"}) {
    for (const int ratio : {1, 4, 20}) {
      Scene scene = falling();
      scene.settings.scheme = scheme;
      scene.settings.set_ratio({ratio, ratio});
      const Verdict verdict = judged(scene);
      EXPECT_EQ(verdict.fault, Fault::none) << scheme << " " << ratio << ": " << verdict.reason;
      EXPECT_NEAR(verdict.unexplained_j, 0.0, 1e-9);
      EXPECT_GT(verdict.put_in_j, 15.0) << "half a kilogram that fell for 0.8 s";
    }
  }
}

TEST_F(RandomScenes, InjectedGainIsFound) {
  const Scene scene = falling();
  const Verdict verdict = judged(scene, gaining(1.002));
  EXPECT_EQ(verdict.fault, Fault::energy) << verdict.reason;
  EXPECT_NE(verdict.reason.find("unexplained"), std::string::npos);
  EXPECT_EQ(judged(scene, gaining(0.999)).fault, Fault::none) << "a loss of energy is no fault";
  const Verdict lost = judged(scene, gaining(NAN));
  EXPECT_EQ(lost.fault, Fault::not_finite) << lost.reason;
}

TEST_F(RandomScenes, ExceptionIsFound) {
  Scene scene = falling();
  scene.settings.world.name = "no_engine";
  const Verdict verdict = judged(scene);
  EXPECT_EQ(verdict.fault, Fault::exception);
  EXPECT_NE(verdict.reason.find("no_engine"), std::string::npos) << verdict.reason;
}

TEST_F(RandomScenes, AnotherHashIsFound) {
  int runs = 0;
  const Verdict verdict = judged(falling(), [&](const EngineSettings& settings, std::span<const Mesh> meshes) {
    return std::make_unique<GainingEngine>(make_engine(settings, meshes), runs++ == 0 ? 0.999 : 0.998);
  });
  EXPECT_EQ(verdict.fault, Fault::hash) << verdict.reason;
}

TEST_F(RandomScenes, CrashAndHangEndOnlyTheChild) {
  EXPECT_EQ(apart(10.0, []() -> Json { return {{"answer", 42}}; }).answer->at("answer"), 42);
  const Apart crashed = apart(10.0, []() -> Json {
    std::raise(SIGKILL);
    return nullptr;
  });
  EXPECT_FALSE(crashed.answer);
  EXPECT_EQ(crashed.end, "SIGKILL");
  const Apart hung = apart(0.3, []() -> Json {
    for (;;) pause();
  });
  EXPECT_FALSE(hung.answer);
  EXPECT_NE(hung.end.find("no end within"), std::string::npos);
}

// A failure caused by a single body leaves that body and the tool, in a short and simple scene.
TEST_F(RandomScenes, ShrinkFindsTheBodyThatMatters) {
  Scene scene;
  std::uint64_t index = 0;
  do {
    scene = random_scene(2, index++);
  } while (scene.bodies.size() < 12 || scene.users.size() < 2 || !scene.settings.delay.any());
  std::string culprit;
  for (const Body& body : scene.bodies) {
    if (!body.fixed()) {
      culprit = body.name;
      break;
    }
  }
  int tries = 0;
  const Scene small = shrunk(scene, [&](const Scene& s) {
    ++tries;
    return std::ranges::find(s.bodies, culprit, &Body::name) != s.bodies.end();
  });
  EXPECT_LE(small.bodies.size(), 2U) << "the culprit and a tool";
  EXPECT_EQ(small.users.size(), 1U);
  EXPECT_EQ(small.settings.ratio, 1);
  EXPECT_EQ(small.settings.scheme, "direct");
  EXPECT_FALSE(small.settings.delay.any());
  EXPECT_LE(small.settings.duration_s, 0.05);
  EXPECT_TRUE(small.users[0].device.path.empty());
  EXPECT_LE(tries, 300);
  EXPECT_NO_THROW((void)as_written(small, folder_)) << "the saved scene can be loaded";
}

// The injected gain through the whole process: it is found, shrunk, and still present after reading the file again.
TEST_F(RandomScenes, InjectedGainIsShrunkAndSaved) {
  Scene scene;
  std::uint64_t index = 0;
  do {
    scene = random_scene(4, index++);
  } while (scene.bodies.size() < 8 || judged(scene, gaining(1.005)).fault != Fault::energy);
  const Scene small = shrunk(
      scene, [&](const Scene& s) { return judged(as_written(s, folder_), gaining(1.005)).fault == Fault::energy; }, 80);
  EXPECT_LE(small.bodies.size(), 4U);
  Scene again = load_scene(write_scene(small, folder_));
  keep_users(again, static_cast<int>(again.users.size()));
  EXPECT_EQ(judged(again, gaining(1.005)).fault, Fault::energy);
  EXPECT_EQ(judged(again).fault, Fault::none);
}

TEST_F(RandomScenes, ThreeOfThemHoldInBullet) {
  std::filesystem::create_directories(folder_);
  const RandomRequest request{.scenes = 3, .seed = 1, .only = {}, .settings = {{"bullet", "fast"}}, .out = folder_};
  const Rows rows = random_rows(request);
  ASSERT_EQ(rows.size(), 3U);
  for (const Json& row : rows) EXPECT_EQ(row.at("fault"), "none") << row.dump();
}

}  // namespace
}  // namespace subworld
