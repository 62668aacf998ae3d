#include "picture.hpp"

#include "joint_marks.hpp"
#include "model/error.hpp"
#include "model/shapes/shape_extent.hpp"
#include "support/png_reader.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

namespace subworld {
namespace {

constexpr double kCubeHalf_m = 0.05;

struct TestScene {
  std::vector<Body> bodies;
  std::vector<BodyState> states;
  std::vector<Mesh> meshes;
  std::vector<UserView> users;
  std::vector<Joint> joints;

  BodyId add(const Shape& shape, double mass_kg, const Vec3& position) {
    Body body;
    body.id = BodyId(bodies.size());
    body.shape = shape;
    body.mass = mass_kg;
    BodyState state;
    state.position = position;
    bodies.push_back(body);
    states.push_back(state);
    return body.id;
  }
  BodyId add_cube(const Vec3& position) { return add(box(Vec3::Constant(kCubeHalf_m)), 0.2, position); }

  static Shape box(const Vec3& half_extents) { return {.kind = ShapeKind::box, .half_extents = half_extents}; }
  static Shape sphere(double radius) { return {.kind = ShapeKind::sphere, .radius = radius}; }

  [[nodiscard]] Picture picture() const {
    return {bodies, states, meshes, users, std::nullopt, std::nullopt, joints, {}};
  }
};

BoundaryContact border_pair(BodyId inside, const Vec3& impulse) {
  BoundaryContact pair;
  pair.inside = inside;
  pair.normal = impulse.normalized();
  pair.normal_impulse = impulse.norm();
  return pair;
}

// Random cubes in a bin without a floor, which would be grey too; the proxy is in the middle.
TestScene heap() {
  TestScene scene;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> along(-1.0, 1.0);
  UserView user;
  user.proxy = scene.add(TestScene::sphere(0.06), 0.1, Vec3(0.0, 0.0, 0.3));
  user.members.push_back(user.proxy);
  for (int i = 0; i < 100; ++i) {
    const Vec3 position(0.4 * along(random), 0.4 * along(random), 0.3 + 0.3 * along(random));
    const BodyId id = scene.add_cube(position);
    scene.states.back().orientation = Quat(1.0, along(random), along(random), along(random)).normalized();
    const double distance = (position - scene.states[0].position).norm();
    if (distance > 0.25) continue;
    user.members.push_back(id);
    if (distance > 0.18) user.border.push_back(border_pair(id, Vec3(0.0, 0.0, 0.01)));
  }
  scene.users.push_back(user);
  return scene;
}

using Rgb = const std::uint8_t*;
bool is_red(Rgb p) { return p[0] > 90 && p[0] > 1.7 * p[1] && p[0] > 1.7 * p[2]; }
bool is_blue(Rgb p) { return p[2] > 1.3 * p[0] && p[2] > 1.12 * p[1]; }
bool is_yellow(Rgb p) { return p[0] > 1.5 * p[2] && p[1] > 1.3 * p[2]; }
bool is_grey(Rgb p) { return p[0] > 90 && p[0] < 228 && std::abs(p[0] - p[2]) < 14 && std::abs(p[0] - p[1]) < 10; }

bool is_magenta(Rgb p) { return p[0] > 120 && p[2] > 90 && p[0] > 2 * p[1] && p[2] > 1.7 * p[1]; }

int count(const Image& image, bool (*is)(Rgb), const std::function<bool(int, int)>& where = nullptr) {
  int sum = 0;
  for (int row = 0; row < image.height; ++row) {
    for (int column = 0; column < image.width; ++column) {
      if (is(image.pixel(column, row)) && (!where || where(column, row))) ++sum;
    }
  }
  return sum;
}

Rgb pixel_at(const Drawing& drawing, const Vec3& point) {
  const auto at = project(drawing.camera, drawing.image.width, drawing.image.height, point);
  EXPECT_TRUE(at.has_value());
  const int column = std::clamp(static_cast<int>(at->column), 0, drawing.image.width - 1);
  const int row = std::clamp(static_cast<int>(at->row), 0, drawing.image.height - 1);
  return drawing.image.pixel(column, row);
}

// Whether a pixel is inside the disc of one of these bodies.
std::function<bool(int, int)> within(const TestScene& scene, const Drawing& drawing, const std::vector<BodyId>& ids) {
  struct Disc {
    double column, row, radius;
  };
  std::vector<Disc> discs;
  for (const auto id : ids) {
    const auto at =
        project(drawing.camera, drawing.image.width, drawing.image.height, scene.states[index(id)].position);
    const double radius = bounding_radius(scene.bodies[index(id)].shape, scene.meshes);
    discs.push_back({at->column, at->row, 1.15 * radius / at->metres_per_pixel + 2.0});
  }
  return [discs](int column, int row) {
    return std::ranges::any_of(discs,
                               [&](const Disc& d) { return std::hypot(column - d.column, row - d.row) < d.radius; });
  };
}

Drawing drawn(const Picture& picture) { return draw(picture, {640, 360}); }

TEST(Picture, ShowsEveryRoleInItsColourWhereItsBodiesAre) {
  const auto scene = heap();
  const auto drawing = drawn(scene.picture());
  const Image& image = drawing.image;
  const int blue = count(image, is_blue);
  const int yellow = count(image, is_yellow);
  EXPECT_GT(blue, 400);
  EXPECT_GT(yellow, 1000);
  EXPECT_GT(count(image, is_grey), 10000);
  const auto& members = scene.users[0].members;
  EXPECT_GT(count(image, is_blue, within(scene, drawing, members)), 0.99 * blue);
  EXPECT_GT(count(image, is_yellow, within(scene, drawing, members)), 0.99 * yellow);
  EXPECT_GT(count(image, is_red, within(scene, drawing, {scene.users[0].proxy})), 150);
}

TEST(Picture, IsAllGreyWithoutUsers) {
  auto scene = heap();
  scene.users.clear();
  const auto drawing = drawn(scene.picture());
  EXPECT_EQ(count(drawing.image, is_blue), 0);
  EXPECT_EQ(count(drawing.image, is_yellow), 0);
  EXPECT_EQ(count(drawing.image, is_red), 0);
  EXPECT_GT(count(drawing.image, is_grey), 10000);
  EXPECT_EQ(drawing.line_m_per_n_s, 0.0);
}

TEST(Picture, ShowsTheProxyBehindOtherBodiesAndMembersBehindAWall) {
  TestScene scene;
  UserView user;
  user.proxy = scene.add(TestScene::sphere(0.06), 0.1, Vec3(-0.3, 0.0, 0.0));
  const auto member = scene.add_cube(Vec3(0.3, 0.0, 0.0));
  const auto veil = scene.add(TestScene::box(Vec3(0.1, 0.02, 0.1)), 1.0, Vec3(-0.3, -0.3, 0.0));
  scene.add(TestScene::box(Vec3(0.1, 0.02, 0.1)), 0.0, Vec3(0.3, -0.3, 0.0));
  user.members = {user.proxy, member};
  scene.users = {user};
  auto picture = scene.picture();
  picture.camera = Camera{Vec3(0.0, -3.0, 0.0), Vec3::Zero(), 0.5};
  const auto drawing = drawn(picture);
  Rgb proxy = pixel_at(drawing, scene.states[0].position);
  EXPECT_GT(proxy[0], proxy[1] + 50);
  EXPECT_TRUE(is_blue(pixel_at(drawing, scene.states[index(member)].position)));
  EXPECT_TRUE(is_grey(pixel_at(drawing, scene.states[index(veil)].position + Vec3(-0.08, -0.02, 0.08))));
}

TEST(Picture, DrawsImpulsesFromTheBorderBodyAlongTheirSum) {
  TestScene scene;
  UserView user;
  user.proxy = scene.add(TestScene::sphere(0.03), 0.1, Vec3(-0.4, 0.0, 0.0));
  const auto border = scene.add_cube(Vec3::Zero());
  user.members = {user.proxy, border};
  // The sum is along x; neither summand is.
  user.border = {border_pair(border, Vec3(0.01, 0.0, 0.02)), border_pair(border, Vec3(0.01, 0.0, -0.02))};
  scene.users = {user};
  auto picture = scene.picture();
  picture.camera = Camera{Vec3(0.0, -2.0, 0.0), Vec3::Zero(), 0.6};
  picture.line_m_per_n_s = 10.0;
  const auto drawing = drawn(picture);
  EXPECT_EQ(drawing.line_m_per_n_s, 10.0);
  EXPECT_TRUE(is_red(pixel_at(drawing, Vec3(0.08, 0.0, 0.0))));
  EXPECT_TRUE(is_red(pixel_at(drawing, Vec3(0.18, 0.0, 0.0))));
  EXPECT_FALSE(is_red(pixel_at(drawing, Vec3(0.22, 0.0, 0.0))));
  EXPECT_TRUE(is_yellow(pixel_at(drawing, Vec3(-0.03, 0.0, 0.0))));
  picture.line_m_per_n_s.reset();
  EXPECT_GT(drawn(picture).line_m_per_n_s, 2.0 * kCubeHalf_m / 0.02);
}

// At a contact that may come soon, the pushing body may be outside as well.
TEST(Picture, DrawsNoBorderBetweenTwoBodiesOutside) {
  TestScene scene;
  UserView user;
  user.proxy = scene.add(TestScene::sphere(0.03), 0.1, Vec3(-0.4, 0.0, 0.0));
  const auto ghost = scene.add_cube(Vec3::Zero());
  user.members = {user.proxy};
  user.border = {border_pair(ghost, Vec3(0.02, 0.0, 0.0))};
  scene.users = {user};
  auto picture = scene.picture();
  picture.camera = Camera{Vec3(0.0, -2.0, 0.0), Vec3::Zero(), 0.6};
  const auto drawing = drawn(picture);
  EXPECT_EQ(drawing.line_m_per_n_s, 0.0);
  EXPECT_EQ(count(drawing.image, is_yellow), 0);
  EXPECT_TRUE(is_grey(pixel_at(drawing, Vec3::Zero())));
}

TEST(Picture, OmitsBodiesThatCannotBeDrawn) {
  auto scene = heap();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  scene.states[3].position.x() = nan;
  scene.states[4].orientation.coeffs().setConstant(nan);
  scene.states[5].linear_velocity.y() = std::numeric_limits<double>::infinity();
  scene.states[6].position.setConstant(1e300);
  scene.states[7].orientation.coeffs().setZero();
  scene.users[0].border.push_back(border_pair(BodyId(3), Vec3(1.0, 0.0, 0.0)));
  scene.users[0].border.push_back(border_pair(BodyId(2), Vec3(nan, 0.0, 0.0)));
  scene.users[0].members.push_back(BodyId(100000));
  scene.add({.kind = ShapeKind::convex, .mesh = 5}, 1.0, Vec3::Zero());
  scene.meshes.push_back({"broken", {Vec3::UnitX(), Vec3::UnitY(), Vec3(nan, 0.0, 0.0)}, {{0, 1, 2}, {0, 1, 9}}});
  scene.add({.kind = ShapeKind::mesh, .mesh = 0}, 0.0, Vec3::Zero());
  const auto drawing = drawn(scene.picture());
  EXPECT_EQ(drawing.omitted, 6U);
  EXPECT_GT(count(drawing.image, is_grey), 10000);
  EXPECT_GT(count(drawing.image, is_yellow), 1000);
  for (auto& state : scene.states) state.position.setConstant(nan);
  EXPECT_EQ(drawn(scene.picture()).omitted, scene.bodies.size());
  EXPECT_EQ(drawn({}).image.width, 640);
}

TEST(Picture, ShowsEveryShape) {
  TestScene scene;
  const Vec3 o(-0.05, -0.05, -0.05);
  scene.meshes.push_back({"tetrahedron",
                          {o, o + 0.2 * Vec3::UnitX(), o + 0.2 * Vec3::UnitY(), o + 0.2 * Vec3::UnitZ()},
                          {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}});
  const std::vector<Shape> shapes{TestScene::sphere(0.05),
                                  TestScene::box(Vec3::Constant(0.05)),
                                  {.kind = ShapeKind::capsule, .radius = 0.03, .half_length = 0.05},
                                  {.kind = ShapeKind::cylinder, .radius = 0.04, .half_length = 0.05},
                                  {.kind = ShapeKind::convex, .mesh = 0},
                                  {.kind = ShapeKind::mesh, .mesh = 0}};
  for (const auto& shape : shapes) {
    const double x = 0.25 * static_cast<double>(scene.bodies.size());
    scene.add(shape, shape.kind == ShapeKind::mesh ? 0.0 : 1.0, Vec3(x, 0.0, 0.0));
  }
  auto picture = scene.picture();
  picture.camera = Camera{Vec3(0.625, -4.0, 0.0), Vec3(0.625, 0.0, 0.0), 0.3};
  const auto drawing = drawn(picture);
  Picture nothing;
  nothing.camera = picture.camera;
  const auto background = drawn(nothing);
  const auto shows = [&](const Vec3& point) {
    return std::abs(pixel_at(drawing, point)[0] - pixel_at(background, point)[0]) > 5;
  };
  EXPECT_EQ(drawing.omitted, 0U);
  for (const auto& state : scene.states) EXPECT_TRUE(shows(state.position)) << state.position.x();
  EXPECT_TRUE(shows(Vec3(0.5, 0.0, -0.074)));
  EXPECT_FALSE(shows(Vec3(0.527, 0.0, -0.074))) << "a capsule's end is round";
  EXPECT_TRUE(shows(Vec3(0.787, 0.0, -0.047))) << "a cylinder's is not";
  scene.add({.kind = ShapeKind::plane}, 0.0, Vec3(0.0, 0.0, -0.2));
  auto with_ground = scene.picture();
  with_ground.camera = Camera{Vec3(0.6, -2.0, 1.0), Vec3(0.6, 0.0, 0.0), 0.5};
  const auto on_ground = drawn(with_ground);
  with_ground.bodies = with_ground.bodies.first(scene.bodies.size() - 1);
  EXPECT_NE(drawn(with_ground).image.rgb, on_ground.image.rgb);
}

TEST(Picture, IsTheSameForTheSameSceneAndKeepsAGivenCamera) {
  const auto scene = heap();
  const auto first = drawn(scene.picture());
  auto picture = scene.picture();
  picture.camera = first.camera;
  EXPECT_EQ(drawn(picture).image.rgb, first.image.rgb);
}

TEST(Picture, RefusesNonsense) {
  auto picture = Picture{};
  picture.camera = Camera{Vec3::Zero(), Vec3::Zero(), 0.5};
  EXPECT_THROW((void)drawn(picture), Error);
  EXPECT_THROW((void)draw({}, {0, 720}), Error);
  EXPECT_THROW(write_png(testing::TempDir() + "/subworld_nonsense.png", {2, 2, {1, 2, 3}}, "Subworld"), Error);
  EXPECT_THROW(write_png("no_such_folder/picture.png", {1, 1, {1, 2, 3}}, "Subworld"), Error);
}

Joint joint_of(JointKind kind, std::initializer_list<std::size_t> free, BodyId a, BodyId b) {
  Joint joint;
  joint.kind = kind;
  joint.a = a;
  joint.b = b;
  for (const std::size_t axis : free) joint.axes[axis].free = true;
  return joint;
}

/// Two cubes beside each other, and a joint in the middle of the left one, as seen along y.
struct JointScene : TestScene {
  explicit JointScene(const Joint& joint) {
    const BodyId a = add_cube(Vec3(-0.06, 0.0, 0.0)), b = add_cube(Vec3(0.06, 0.0, 0.0));
    joints = {joint};
    joints[0].a = a;
    joints[0].b = b;
    joints[0].in_b.position = states[0].position - states[1].position;
  }
  [[nodiscard]] Picture seen() const {
    auto one = picture();
    one.camera = Camera{Vec3(0.0, -2.0, 0.0), Vec3::Zero(), 0.2};
    return one;
  }
  /// Largest distances, in pixels, of magenta pixels from the joint's place, to the side and upwards.
  [[nodiscard]] std::pair<double, double> extents() const {
    const auto drawing = drawn(seen());
    const auto at = project(drawing.camera, drawing.image.width, drawing.image.height, states[0].position);
    std::pair<double, double> most{0.0, 0.0};
    (void)count(drawing.image, is_magenta, [&](int column, int row) {
      most.first = std::max(most.first, std::abs(column + 0.5 - at->column));
      most.second = std::max(most.second, std::abs(row + 0.5 - at->row));
      return true;
    });
    return most;
  }
};

TEST(Picture, DrawsJointsInsideOfBodiesByTheirFreeDirections) {
  const auto extents = [](JointKind kind, std::initializer_list<std::size_t> free) {
    return JointScene(joint_of(kind, free, {}, {})).extents();
  };
  const auto hinge = extents(JointKind::hinge, {3}), upright = extents(JointKind::hinge, {5});
  EXPECT_GT(hinge.first, 2.5 * hinge.second) << "along x";
  EXPECT_GT(upright.second, 2.5 * upright.first) << "along z";
  const auto slider = extents(JointKind::slider, {0});
  EXPECT_GT(slider.first, 1.5 * hinge.first);
  const auto ball = extents(JointKind::ball, {3, 4, 5});
  EXPECT_NEAR(ball.first, ball.second, 1.01);
  EXPECT_GT(ball.first, 4.0);
  const auto cross = extents(JointKind::universal, {3, 5});
  EXPECT_NEAR(cross.first, hinge.first, 1.01);
  EXPECT_NEAR(cross.second, upright.second, 1.01);
  const auto fixed = extents(JointKind::fixed, {});
  EXPECT_GT(fixed.first, 1.0);
  EXPECT_LT(fixed.first, 0.5 * hinge.first);
}

TEST(Picture, DrawsNoBrokenJointAndNoneOfABodyThatCannotBeDrawn) {
  JointScene scene(joint_of(JointKind::ball, {3, 4, 5}, {}, {}));
  auto picture = scene.seen();
  EXPECT_GT(count(drawn(picture).image, is_magenta), 50);
  constexpr std::uint32_t kBroken[]{0};
  picture.broken_joints = kBroken;
  EXPECT_EQ(count(drawn(picture).image, is_magenta), 0);
  scene.states[1].position.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(count(drawn(scene.seen()).image, is_magenta), 0);
  scene.joints[0].b = BodyId(7);
  EXPECT_EQ(count(drawn(scene.seen()).image, is_magenta), 0);
}

/// With any states of the bodies, the marks are where the physics has the joint, and along its free directions.
TEST(JointMarks, AreAlongTheDirectionsOfTheJoint) {
  TestScene scene;
  const BodyId a = scene.add_cube(Vec3(0.3, 0.1, 0.2)), b = scene.add_cube(Vec3(-0.1, 0.4, 0.0));
  scene.states[0].orientation = Quat(0.3, 0.5, -0.2, 0.7).normalized();
  scene.states[1].orientation = Quat(0.6, -0.1, 0.4, 0.2).normalized();
  const std::vector<std::vector<std::size_t>> all{{3},    {4}, {5},    {3, 4},    {4, 5},
                                                  {3, 5}, {0}, {2, 5}, {0, 1, 5}, {0, 2, 3, 4}};
  for (const auto& free : all) {
    Joint joint = joint_of(JointKind::six, {}, a, b);
    for (const std::size_t axis : free) joint.axes[axis].free = true;
    joint.in_a = {Vec3(0.01, 0.02, 0.03), Quat(0.9, 0.1, 0.3, 0.2).normalized()};
    joint.in_b = {Vec3(0.04, -0.02, 0.01), Quat(0.2, 0.8, 0.1, -0.4).normalized()};
    const JointPlace truth = place_of(joint, pose_of(scene.states[0]), pose_of(scene.states[1]));
    std::vector<bool> found(6);
    for (const JointMark& mark : joint_marks({&joint, 1}, scene.bodies, {}, {})) {
      const Pose place = place_of(mark, scene.states[index(mark.at)], scene.states[index(mark.along)]);
      const Vec3 along = place.orientation * Vec3::UnitZ();
      EXPECT_NEAR((place.position - truth.point - mark.shift * along).norm(), 0.0, 1e-12);
      for (const std::size_t axis : free)
        if (std::abs(along.dot(truth.directions[axis])) > 1.0 - 1e-9) found[axis] = true;
    }
    for (const std::size_t axis : free) EXPECT_TRUE(found[axis]) << free.size() << " free, axis " << axis;
  }
}

TEST(Camera, ShowsAllMovableBodiesAsLargeAsPossible) {
  auto scene = heap();
  scene.states[9].position = Vec3(0.0, 0.0, -500.0);  // fell through
  const auto drawing = drawn(scene.picture());
  double top = 1e9;
  double bottom = -1e9;
  for (std::size_t i = 0; i < scene.states.size(); ++i) {
    if (i == 9) continue;
    const auto at = project(drawing.camera, 640, 360, scene.states[i].position);
    ASSERT_TRUE(at && at->column > 0.0 && at->column < 640.0 && at->row > 0.0 && at->row < 360.0) << i;
    top = std::min(top, at->row);
    bottom = std::max(bottom, at->row);
  }
  EXPECT_GT(bottom - top, 0.6 * 360.0);
}

TEST(Camera, RunsARowAcrossThePicture) {
  TestScene scene;
  for (int i = 0; i < 10; ++i) scene.add_cube(Vec3(0.1 * i, 0.0, 0.05));
  const auto camera = drawn(scene.picture()).camera;
  EXPECT_LT(project(camera, 640, 360, scene.states[0].position)->column, 100.0);
  EXPECT_GT(project(camera, 640, 360, scene.states[9].position)->column, 540.0);
}

TEST(Png, ReadsBackWhatWasWritten) {
  const auto drawing = drawn(heap().picture());
  const auto file = std::filesystem::path(testing::TempDir()) / "subworld_picture_test.png";
  write_png(file.string(), drawing.image, "Subworld");
  const Image back = test::read_png(file.string());
  std::filesystem::remove(file);
  EXPECT_EQ(back.width, 640);
  EXPECT_EQ(back.height, 360);
  EXPECT_EQ(back.rgb, drawing.image.rgb);
}

}  // namespace
}  // namespace subworld
