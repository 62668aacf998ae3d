#include "model/scene/scene.hpp"
#include "model/settings/agreed_settings.hpp"
#include "model/settings/settings.hpp"
#include "support/box_overlap.hpp"
#include "support/scene_text.hpp"

#include <fmt/core.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

namespace subworld {
namespace {

std::string file_of(const std::string& scene) { return std::string(SCENES_FOLDER) + "/" + scene + ".yaml"; }
Scene load(const std::string& scene) { return load_scene(file_of(scene)); }

std::string text_of(const std::string& file) {
  std::ifstream in(file);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

/// Movable bodies that are not a user's own proxy (user/proxy).
std::vector<const Body*> cubes(const Scene& scene) {
  std::vector<const Body*> found;
  for (const Body& body : scene.bodies) {
    if (!body.fixed() && !body.name.ends_with("/proxy")) found.push_back(&body);
  }
  return found;
}

/// The deepest overlap of any two boxes, m. Bodies are sorted along x, so that few pairs are tested.
double deepest_overlap(const Scene& scene) {
  struct Ball {
    double lower, upper, y, z, radius;
    const Body* body;
  };
  std::vector<Ball> balls;
  for (const Body& body : scene.bodies) {
    if (body.shape.kind != ShapeKind::box) continue;
    const Vec3& at = scene.initial[index(body.id)].position;
    const double radius = body.shape.half_extents.norm();
    balls.push_back({at.x() - radius, at.x() + radius, at.y(), at.z(), radius, &body});
  }
  std::ranges::sort(balls, {}, &Ball::lower);
  double deepest = -1.0;
  for (std::size_t i = 0; i < balls.size(); ++i) {
    const Ball& a = balls[i];
    for (std::size_t k = i + 1; k < balls.size() && balls[k].lower <= a.upper; ++k) {
      const Ball& b = balls[k];
      if (std::max(std::abs(a.y - b.y), std::abs(a.z - b.z)) > a.radius + b.radius) continue;
      if (a.body->fixed() && b.body->fixed()) continue;
      deepest = std::max(
          deepest, overlap_depth(*a.body, scene.initial[index(a.body->id)], *b.body, scene.initial[index(b.body->id)]));
    }
  }
  return deepest;
}

/// From the centre of `from` to the surface of `box`, m.
double distance_to_box(const Scene& scene, BodyId from, BodyId box) {
  const BodyState& at = scene.initial[index(box)];
  const Vec3 inside = at.orientation.conjugate() * (scene.initial[index(from)].position - at.position);
  return (inside.cwiseAbs() - scene.body(box).shape.half_extents).cwiseMax(0.0).norm();
}

/// The lowest corner of any movable box, m.
double lowest_corner(const Scene& scene) {
  double lowest = 1e9;
  for (const Body& body : scene.bodies) {
    if (body.shape.kind != ShapeKind::box || body.fixed()) continue;
    const BodyState& at = scene.initial[index(body.id)];
    const Vec3 up = at.orientation.conjugate() * Vec3::UnitZ();
    lowest = std::min(lowest, at.position.z() - up.cwiseAbs().dot(body.shape.half_extents));
  }
  return lowest;
}

struct Canon {
  const char* scene;
  std::size_t cubes;
  std::size_t users;
  double box_half_m;
  double duration_s;
};

class CanonicalScene : public testing::TestWithParam<Canon> {};

TEST_P(CanonicalScene, HasWhatTheDesignSays) {
  const Canon& canon = GetParam();
  const Scene scene = load(canon.scene);
  EXPECT_EQ(scene.name, canon.scene) << "a scene is found by its file's name";
  EXPECT_FALSE(scene.description.empty());
  EXPECT_EQ(cubes(scene).size(), canon.cubes);
  EXPECT_EQ(scene.users.size(), canon.users);
  EXPECT_EQ(scene.users.front().box_half_m, canon.box_half_m);
  EXPECT_EQ(scene.settings.duration_s, canon.duration_s);
  EXPECT_EQ(scene.settings.h_s, 0.001);
  EXPECT_EQ(scene.users.front().coupling.stiffness_n_m, 1000.0);
  EXPECT_EQ(scene.users.front().coupling.damping_n_s_m, 20.0);
  EXPECT_EQ(scene.users.front().device.force_limit_n, 40.0);
  for (const Body& body : scene.bodies) {
    EXPECT_EQ(body.material.friction, 0.5) << body.name;
    EXPECT_EQ(body.material.restitution, 0.0) << body.name;
  }
}

TEST_P(CanonicalScene, BodiesAreNumberedNamedOnceAndPlausible) {
  const Scene scene = load(GetParam().scene);
  std::set<std::string> names;
  ASSERT_EQ(scene.bodies.size(), scene.initial.size());
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const Body& body = scene.bodies[i];
    EXPECT_EQ(index(body.id), i);
    EXPECT_TRUE(names.insert(body.name).second) << body.name;
    EXPECT_TRUE(finite(scene.initial[i]));
    EXPECT_NEAR(scene.initial[i].orientation.norm(), 1.0, 1e-12);
    if (!body.fixed()) {
      EXPECT_GT(body.inertia.minCoeff(), 0.0);
    }
  }
}

TEST_P(CanonicalScene, NothingOverlapsAtTheStart) {
  const Scene scene = load(GetParam().scene);
  for (const UserSpec& user : scene.users) {
    if (scene.body(user.proxy).shape.kind != ShapeKind::sphere || user.joins_late) continue;
    for (const Body& body : scene.bodies) {
      if (body.shape.kind != ShapeKind::box) continue;
      EXPECT_GT(distance_to_box(scene, user.proxy, body.id), scene.body(user.proxy).shape.radius) << body.name;
    }
  }
  EXPECT_LT(deepest_overlap(scene), 1e-9);
  if (std::string(GetParam().scene) != "slope") {
    EXPECT_GT(lowest_corner(scene), -1e-9);
  }
}

TEST(SceneLibrary, ARowMayStepAnyWay) {
  const Scene slope = load("slope");
  const Vec3 step = slope.initial[2].position - slope.initial[1].position;
  EXPECT_LT((step - Vec3(0.098481, 0, 0.017365)).norm(), 1e-5);
}

INSTANTIATE_TEST_SUITE_P(Design10, CanonicalScene,
                         testing::Values(Canon{"row", 10, 1, 0.30, 3.0}, Canon{"press", 1, 1, 0.20, 2.0},
                                         Canon{"scatter", 56, 1, 0.20, 2.5}, Canon{"tower_inside", 10, 1, 0.16, 3.0},
                                         Canon{"tower_press", 10, 1, 0.16, 3.0},
                                         Canon{"tower_inside_20", 20, 1, 0.16, 3.0},
                                         Canon{"tower_press_20", 20, 1, 0.16, 3.0}, Canon{"raft", 10, 1, 0.24, 3.0},
                                         Canon{"hidden_load", 8, 1, 0.30, 3.0}, Canon{"heavy_outside", 5, 1, 0.30, 3.0},
                                         Canon{"slope", 6, 1, 0.30, 3.0}, Canon{"pyramid", 10, 1, 0.20, 3.0},
                                         Canon{"see_saw", 3, 1, 0.10, 2.0}, Canon{"leaning", 5, 1, 0.18, 2.0},
                                         Canon{"loose", 5, 1, 0.30, 3.0}, Canon{"toppling", 2, 1, 0.15, 2.5},
                                         Canon{"tower_base", 8, 1, 0.12, 3.0}, Canon{"heap", 250, 2, 0.20, 10.0},
                                         Canon{"lift", 1, 2, 0.20, 2.8}, Canon{"squeeze", 6, 2, 0.20, 3.0},
                                         Canon{"crossing", 6, 2, 0.20, 3.0}, Canon{"carry", 10, 4, 0.20, 2.6},
                                         Canon{"turn", 3, 1, 0.20, 3.0}, Canon{"turn_rows", 6, 1, 0.20, 3.0},
                                         Canon{"weight", 1, 2, 0.20, 3.0}, Canon{"hand_over", 1, 4, 0.20, 3.0},
                                         Canon{"press_turn", 1, 2, 0.20, 2.5}, Canon{"devices", 1, 4, 0.20, 2.0},
                                         Canon{"stir", 250, 16, 0.12, 2.0}, Canon{"stack", 50, 1, 0.20, 10.0},
                                         Canon{"card_house", 89, 1, 0.20, 10.0}, Canon{"basin", 8000, 1, 0.20, 24.0}),
                         [](const auto& at) { return std::string(at.param.scene); });

// A flag that names an engine without the scene's preset.
TEST(SceneLibrary, AnotherEngineHasAPresetOfItsOwn) {
  const auto preset = [](const std::vector<SettingChange>& changes) {
    Scene scene = load_scene(std::string(SCENES_FOLDER) + "/basin.yaml");
    apply_changes(changes, scene);
    return scene.settings.world.preset;
  };
  EXPECT_EQ(preset({}), "large");
  EXPECT_EQ(preset({{"world.engine", "bullet"}}), "large") << "the other precision";
  EXPECT_EQ(preset({{"world.engine", "rapier"}}), "fast");
  EXPECT_EQ(preset({{"world.preset", "quality"}, {"world.engine", "rapier"}}), "quality");
}

TEST(SceneLibrary, EveryFileIsTested) {
  const std::set<std::string> tested{
      "row",          "press",           "scatter",        "tower_inside", "tower_press", "tower_base",    "heap",
      "heap_press",   "tower_inside_20", "tower_press_20", "raft",         "hidden_load", "heavy_outside", "slope",
      "pyramid",      "see_saw",         "leaning",        "loose",        "toppling",    "lift",          "squeeze",
      "crossing",     "carry",           "turn",           "turn_rows",    "weight",      "stack",         "card_house",
      "basin",        "example",         "first",          "hand_over",    "pull_apart",  "press_turn",    "devices",
      "stir",         "drawer",          "door",           "lever",        "crank",       "chain",         "peg",
      "box_with_lid", "latch",           "assembly",       "conveyor"};
  for (const auto& entry : std::filesystem::directory_iterator(SCENES_FOLDER)) {
    if (entry.path().extension() != ".yaml") continue;
    EXPECT_TRUE(tested.contains(entry.path().stem().string())) << entry.path();
  }
}

TEST(SceneLibrary, RowAndScatterStandWhereTheDesignSays) {
  const Scene row = load("row");
  for (int i = 0; i < 10; ++i) {
    EXPECT_LT((row.initial[static_cast<std::size_t>(1 + i)].position - Vec3(0.1 * i, 0, 0.05)).norm(), 1e-12);
  }
  EXPECT_EQ(row.initial[index(row.users[0].proxy)].position, Vec3(-0.10, 0, 0.05));
  const Body& proxy = row.body(row.users[0].proxy);
  EXPECT_EQ(proxy.shape.radius, 0.03);
  EXPECT_EQ(proxy.mass, 0.1);
  EXPECT_FALSE(proxy.gravity);
  EXPECT_FALSE(proxy.rotates);
  const Scene scatter = load("scatter");
  EXPECT_LT((scatter.initial[2].position - Vec3(0.25, -0.70, 0.05)).norm(), 1e-12) << "odd columns are shifted";
  EXPECT_LT((scatter.initial[56].position - Vec3(1.75, 0.80, 0.05)).norm(), 1e-12);
}

TEST(SceneLibrary, TowerProxiesAreBodiesOfTheTower) {
  const Scene inside = load("tower_inside");
  EXPECT_EQ(inside.body(inside.users[0].proxy).name, "tower/5");
  EXPECT_EQ(inside.bodies.size(), 11U);
  const Scene base = load("tower_base");
  // Only the lowest two cubes intersect the selection box where the proxy touches the tower.
  const double top = base.initial[index(base.users[0].proxy)].position.z() + base.users[0].box_half_m;
  EXPECT_GT(top, 0.1);
  EXPECT_LT(top, 0.2);
}

TEST(SceneLibrary, HeapIsTheSameBitsEveryTime) {
  const Scene first = load("heap");
  const Scene second = load("heap");
  EXPECT_EQ(settings_hash(first), settings_hash(second));
  for (std::size_t i = 0; i < first.bodies.size(); ++i) {
    EXPECT_EQ(first.initial[i].position, second.initial[i].position);
    EXPECT_EQ(first.initial[i].orientation.coeffs(), second.initial[i].orientation.coeffs());
  }
  EXPECT_EQ(first.settings.users, 1);
  EXPECT_EQ(first.settings.settle_s, 3.0);
  EXPECT_EQ(first.settings.settle_step_s, 0.004);
}

/// The cubes start inside the bin's walls, so they land in the bin; the users join when the cubes are at rest.
TEST(SceneLibrary, HeapStartsInsideTheBinAndWithoutTheUsers) {
  const Scene heap = load("heap");
  for (const Body* cube : cubes(heap)) {
    const BodyState& at = heap.initial[index(cube->id)];
    const Eigen::Matrix3d turn = at.orientation.toRotationMatrix();
    const Vec3 reach = turn.cwiseAbs() * cube->shape.half_extents;
    EXPECT_LT(std::abs(at.position.x()) + reach.x(), 0.4);
    EXPECT_LT(std::abs(at.position.y()) + reach.y(), 0.4);
    EXPECT_GT(at.position.z() - reach.z(), 0.35);
  }
  for (const UserSpec& user : heap.users) EXPECT_TRUE(user.joins_late) << user.name;
}

class SceneWithBin : public testing::TestWithParam<const char*> {};

TEST_P(SceneWithBin, PathsStayInsideIt) {
  const Scene heap = load(GetParam());
  for (const UserSpec& user : heap.users) {
    const double radius = heap.body(user.proxy).shape.radius;
    for (double t = 0.0; t < 70.0; t += 0.01) {
      const Vec3 at = heap.initial[index(user.proxy)].position + evaluate(user.device.path, t).offset.position;
      EXPECT_LT(at.head<2>().cwiseAbs().maxCoeff() + radius, 0.4);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, SceneWithBin, testing::Values("heap", "stir"));

/// Each on a circle of its own: whoever touches another does so through the cubes.
TEST(SceneLibrary, UsersWhoStirDoNotCollide) {
  const Scene stir = load("stir");
  const auto at = [&](std::size_t u, double t) -> Vec3 {
    return stir.initial[index(stir.users[u].proxy)].position + evaluate(stir.users[u].device.path, t).offset.position;
  };
  const double touching_m = 2.0 * stir.body(stir.users[0].proxy).shape.radius;
  for (std::size_t u = 0; u < stir.users.size(); ++u) {
    for (std::size_t other = 0; other < u; ++other) {
      for (double t = 0.0; t < 2.0; t += 0.05) EXPECT_GT((at(u, t) - at(other, t)).norm(), touching_m + 0.05);
    }
  }
}

TEST(CardHouse, Has56LeaningAnd33FlatCardsThatNearlyTouch) {
  const Scene house = load("card_house");
  int leaning = 0;
  int flat = 0;
  double highest = 0.0;
  for (const Body* card : cubes(house)) {
    const BodyState& at = house.initial[index(card->id)];
    const double up = (at.orientation * Vec3::UnitX()).z();  // of the card's long side
    if (std::abs(up - std::cos(20.0 * M_PI / 180.0)) < 1e-12) ++leaning;
    if (std::abs(up) < 1e-12) ++flat;
    highest = std::max(highest, at.position.z());
    // Every card is supported: another body is within 0.1 mm below or beside it.
    double nearest = card->shape.half_extents.norm();
    for (const Body* other : cubes(house)) {
      if (other == card) continue;
      nearest = std::min(nearest, -overlap_depth(*card, at, *other, house.initial[index(other->id)]));
    }
    EXPECT_LT(nearest, 1e-4) << card->name;
    EXPECT_GT(nearest, 0.0) << card->name;
  }
  EXPECT_EQ(leaning, 56);
  EXPECT_EQ(flat, 33);
  EXPECT_GT(highest, 6.0);
  EXPECT_NEAR(lowest_corner(house), 1e-5, 1e-9);
}

TEST(SettingsHash, SeesWhatProgramsMustShareAndNothingElse) {
  const Scene scene = load("row");
  const auto changed = [&](auto&& change) {
    Scene other = scene;
    change(other);
    return settings_hash(other) != settings_hash(scene);
  };
  EXPECT_FALSE(changed([](Scene&) {}));
  EXPECT_FALSE(changed([](Scene& s) { s.settings.duration_s = 99; }));
  EXPECT_FALSE(changed([](Scene& s) { s.file = "elsewhere.yaml"; }));
  EXPECT_FALSE(changed([](Scene& s) { s.initial[1].position.y() = -0.0; })) << "-0 is 0";
  EXPECT_TRUE(changed([](Scene& s) { s.settings.ratio = 5; }));
  EXPECT_TRUE(changed([](Scene& s) { s.settings.h_s = 0.0005; }));
  EXPECT_TRUE(changed([](Scene& s) { s.settings.scheme = "direct"; }));
  EXPECT_TRUE(changed([](Scene& s) { s.settings.haptic.substeps = 2; }));
  EXPECT_TRUE(changed([](Scene& s) { s.settings.mode = Mode::realtime; }));
  EXPECT_TRUE(changed([](Scene& s) { s.bodies[3].mass = 0.3; }));
  EXPECT_TRUE(changed([](Scene& s) { s.bodies[3].material.friction = 0.3; }));
  EXPECT_TRUE(changed([](Scene& s) { s.initial[3].position.x() += 1e-12; }));
  EXPECT_TRUE(changed([](Scene& s) { s.users[0].box_half_m = 0.1; }));
  EXPECT_TRUE(changed([](Scene& s) { s.users[0].selection = Selection::box; }));
  EXPECT_TRUE(changed([](Scene& s) { s.users[0].budget_ratio = 0.3; }));
  EXPECT_TRUE(changed([](Scene& s) { s.users[0].device.path.pop_back(); }));
}

TEST(AgreedSettings, NamesWhatDiffersFromTheWorld) {
  const Scene scene = load("row");
  Scene other = scene;
  EXPECT_EQ(difference(agreed_settings(scene), agreed_settings(other)), "");
  other.settings.ratio = 10;
  other.users[0].device.force_limit_n = 12.5;
  EXPECT_EQ(difference(agreed_settings(scene), agreed_settings(other)),
            "settings.ratio is 4, in the world 10; users[0].device.force_limit_n is 40, in the world 12.5");
  other.settings.world.iterations = std::nullopt;
  other.settings.haptic.substeps = 3;
  EXPECT_EQ(difference(agreed_settings(scene), agreed_settings(other), 1),
            "settings.ratio is 4, in the world 10; and 3 more");
  EXPECT_NE(difference(agreed_settings(other), agreed_settings(scene), 9).find("is not set, in the world 50"),
            std::string::npos);
  other = scene;
  other.bodies[3].mass = 0.25;
  EXPECT_EQ(difference(settings_of(other.bodies[3]), settings_of(scene.bodies[3])),
            "mass_kg is 0.25, in the world 0.2");
}

/// A scene with a line below `settings`, and one below its only user, who is an operator.
std::string scene_with(const std::string& setting, const std::string& of_user) {
  return fmt::format(
      "name: x\nsettings: {{{}}}\nbodies: []\nusers:\n  - name: hand\n"
      "    proxy: {{shape: sphere, radius_m: 1, mass_kg: 1, position_m: [0, 0, 0]}}\n    {}\n",
      setting, of_user);
}

/// "a: {b: value}" of the key "a.b".
std::string nested(std::string key, const std::string& value) {
  std::string end;
  for (std::size_t dot = key.find('.'); dot != std::string::npos; dot = key.find('.', dot + 2)) {
    key.replace(dot, 1, ": {");
    end += '}';
  }
  return key + ": " + value + end;
}

/// Another value than the default.
std::string other_value(const Setting& setting) {
  const Setting::Range& range = setting.range;
  if (!range.words.empty()) return std::string(range.words[default_text(setting) == range.words[0] ? 1 : 0]);
  if (setting.key == "users") return "1";
  if (setting.key == "presence") return "\"0 leaves 1\"";
  if (setting.key == "gravity_m_s2") return "[0, 0, -1.5]";
  if (setting.key == "disable") return "[rest]";
  if (setting.key.ends_with("preset")) return "quality";
  if (default_text(setting) == "true") return "false";
  if (range.limits.most > 1e300 && range.limits.least < -1e300) return "other";  // a name
  if (default_text(setting).find('.') != std::string::npos || range.limits.most < 1.0)
    return fmt::format("{}", range.limits.least + 0.125 * (range.limits.most < 2.0 ? range.limits.most : 1.0));
  return fmt::format("{}", range.limits.least + 4.0 > range.limits.most ? range.limits.most : range.limits.least + 4.0);
}

// A row of the table is all that a setting needs: a scene file and --set read it alike and refuse the same, programs
// must share it, and the page of the scenes has its row.
TEST(SettingsTable, ARowIsAllThatASettingNeeds) {
  const std::string page = text_of(std::string(SCENES_FOLDER) + "/README.md");
  const Scene plain = load_text(scene_with("", "device: {operator: {}}"));
  for (const Setting& one : settings_table()) {
    SCOPED_TRACE(one.key);
    const std::string row =
        fmt::format("| `{}` | {} | {} | {} | {} | {} |", one.key, one.unit() == kPartUnit ? "" : one.unit(),
                    default_text(one), range_text(one), one.meaning, one.readers);
    EXPECT_NE(page.find(row), std::string::npos) << "the page of the scenes lacks\n" << row;

    const std::string value = other_value(one);
    const bool of_user = one.of_user();
    const std::string in_file = of_user ? scene_with("", nested(one.key.substr(std::string("users.").size()), value))
                                        : scene_with(nested(one.key, value), "");
    if (one.key != "users.selection") {
      const std::string flag = value.starts_with('"') ? value.substr(1, value.size() - 2) : value;
      const SettingChange change{one.key, flag};
      EXPECT_EQ(setting_fault(change), "");
      Scene from_file = load_text(in_file), from_flag = load_text(scene_with("", ""));
      apply_changes(std::vector{change}, from_flag);
      EXPECT_EQ(difference(agreed_settings(from_file), agreed_settings(from_flag)), "");
      if (one.key.find("operator") == std::string::npos && one.key != "duration_s") {
        EXPECT_NE(difference(agreed_settings(from_file), agreed_settings(load_text(scene_with("", "")))), "");
      }
    }
    const TemporaryFolder folder;
    const std::string wrong = of_user ? scene_with("", nested(one.key.substr(std::string("users.").size()), "{x: 1}"))
                                      : scene_with(nested(one.key, "{x: 1}"), "");
    const std::string refused = refusal(folder.write("scene.yaml", wrong), folder.path());
    EXPECT_TRUE(refused.starts_with("scene.yaml:")) << refused;
    EXPECT_NE(refused.find(of_user ? "users[0]." + one.key.substr(std::string("users.").size()) : one.key),
              std::string::npos)
        << refused;
  }
  EXPECT_EQ(default_text(*find_setting("settings.deadband")), "0");
  EXPECT_EQ(find_setting("users[1].box_half_m"), find_setting("users.box_half_m"));
}

TEST(Example, IsTheOneOnThePage) {
  const std::string page = text_of(std::string(SCENES_FOLDER) + "/README.md");
  const std::string open = "```yaml\n";
  const std::size_t begin = page.find(open) + open.size();
  ASSERT_NE(page.find(open), std::string::npos);
  EXPECT_EQ(page.substr(begin, page.find("```", begin) - begin), text_of(file_of("example")));
}

TEST(Example, LoadsWithEveryShapeGroupAndPath) {
  const Scene scene = load("example");
  std::set<ShapeKind> shapes;
  for (const Body& body : scene.bodies) shapes.insert(body.shape.kind);
  EXPECT_EQ(shapes.size(), 8U);
  EXPECT_EQ(scene.users.size(), 2U);
  EXPECT_EQ(scene.users[1].device.kind, DeviceKind::admittance);
  EXPECT_EQ(scene.settings.world.iterations, 50);
  EXPECT_LT(deepest_overlap(scene), 1e-9);
}

TEST(Example, ThePageNamesEveryScene) {
  const std::string page = text_of(std::string(SCENES_FOLDER) + "/README.md");
  for (const auto& entry : std::filesystem::directory_iterator(SCENES_FOLDER)) {
    if (entry.path().extension() != ".yaml") continue;
    EXPECT_NE(page.find("`" + entry.path().stem().string() + "`"), std::string::npos) << entry.path();
  }
}

}  // namespace
}  // namespace subworld
