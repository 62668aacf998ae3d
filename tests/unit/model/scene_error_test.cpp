#include "support/scene_text.hpp"

#include <gtest/gtest.h>

#include <fmt/core.h>

#include <sys/stat.h>

#include <string>
#include <vector>

namespace subworld {
namespace {

/// A complete scene with one line of each section replaced. The line numbers are those of the table below.
struct Lines {
  std::string settings = "{h_s: 0.001}";                                                       // line 2
  std::string materials = "{wood: {friction: 0.5}}";                                           // line 3
  std::string body = "{name: cube, shape: box, size_m: [0.1, 0.1, 0.1], mass_kg: 0.2}";        // line 5
  std::string proxy = "{shape: sphere, radius_m: 0.03, mass_kg: 0.1, position_m: [1, 0, 0]}";  // line 8
  std::string device = "{rate_hz: 1000}";                                                      // line 9
  std::string more = "";                                                                       // line 10

  [[nodiscard]] std::string text() const {
    return "name: broken\nsettings: " + settings + "\nmaterials: " + materials + "\nbodies:\n  - " + body +
           "\nusers:\n  - name: hand\n    proxy: " + proxy + "\n    device: " + device + "\n" + more;
  }
};

struct Broken {
  std::string_view label;
  std::string text;
  std::string_view place;     ///< line:column
  std::string_view fragment;  ///< of the text after the place
};

void PrintTo(const Broken& broken, std::ostream* out) { *out << broken.label; }

Broken settings(std::string_view label, std::string value, std::string_view place, std::string_view fragment) {
  return {label, Lines{.settings = std::move(value)}.text(), place, fragment};
}
Broken material(std::string_view label, std::string value, std::string_view place, std::string_view fragment) {
  return {label, Lines{.materials = std::move(value)}.text(), place, fragment};
}
Broken body(std::string_view label, std::string value, std::string_view place, std::string_view fragment) {
  return {label, Lines{.body = std::move(value)}.text(), place, fragment};
}
Broken proxy(std::string_view label, std::string value, std::string_view place, std::string_view fragment) {
  return {label, Lines{.proxy = std::move(value)}.text(), place, fragment};
}
Broken device(std::string_view label, std::string value, std::string_view place, std::string_view fragment) {
  return {label, Lines{.device = std::move(value)}.text(), place, fragment};
}
Broken path(std::string_view label, const std::string& value, std::string_view place, std::string_view fragment) {
  return device(label, "{path: [" + value + "]}", place, fragment);
}
Broken repeat(std::string_view label, const std::string& value, std::string_view place, std::string_view fragment) {
  return body(label, "{name: c, shape: box, size_m: [1, 1, 1], mass_kg: 1, repeat: " + value + "}", place, fragment);
}
Broken more(std::string_view label, std::string value, std::string_view place, std::string_view fragment) {
  return {label, Lines{.more = std::move(value)}.text(), place, fragment};
}

std::vector<Broken> broken_scenes() {
  const std::string users = "users: [{name: hand, proxy: {shape: sphere, radius_m: 1, mass_kg: 1}}]\n";
  return {
      // The document.
      {"empty", "", "1:1", "is empty"},
      {"only_a_comment", "# nothing\n", "1:1", "is empty"},
      {"not_a_map", "- a\n- b\n", "1:1", "must be a map of keys and values, not a list"},
      {"a_word", "heap\n", "1:1", "must be a map"},
      {"open_bracket", "name: [a, b\n", "2:1", "not YAML"},
      {"tab_indent", "name: x\nsettings:\n\th_s: 1\n", "3:1", "a tab in the indentation; YAML takes spaces only"},
      {"two_documents", "name: a\n---\nname: b\n", "3:1", "a second document"},
      {"anchor", "name: &a x\nbodies: *a\n", "1:7", "anchors (&name) are not part"},
      {"alias_without_anchor", "name: *a\n", "1:7", "not YAML"},
      {"tag", "name: !thing x\n", "1:7", "tags (!thing) are not part"},
      {"map_as_key", "{a: 1}: 2\n", "1:1", "a key must be a plain word"},
      {"deep", "name: " + std::string(100, '[') + std::string(100, ']') + "\n", "1:38", "nested more than 32 levels"},
      {"very_deep", "name: " + std::string(100'000, '['), "1:8", "a key must be a plain word, not a list"},
      {"missing_name", "bodies: []\n" + users, "1:1", "\"name\" is missing"},
      {"missing_bodies", "name: x\n" + users, "1:1", "\"bodies\" is missing"},
      {"missing_users", "name: x\nbodies: []\n", "1:1", "\"users\" is missing"},
      {"no_user", "name: x\nbodies: []\nusers: []\n", "3:8", "users: a scene needs at least one user"},
      {"null_name", "name:\nbodies: []\n" + users, "1:1", "name: must be text, not nothing"},
      {"path_as_name", "name: ../x\nbodies: []\n" + users, "1:7", "name: \"../x\" is not a name"},
      more("unknown_key", "bodys: []\n", "10:1", "bodys: unknown key; did you mean \"bodies\"?"),
      more("key_twice", "users: []\n", "10:1", "users: stands twice in this map; remove one"),

      // Settings.
      settings("wrong_unit", "{duration_ms: 5}", "2:12",
               "settings.duration_ms: unknown key; did you mean \"duration_s\"?"),
      settings("no_unit", "{duration: 5}", "2:12", "settings.duration: unknown key; did you mean \"duration_s\"?"),
      settings("far_key", "{colour: red}", "2:12", "settings.colour: unknown key; known here are h_s, ratio"),
      settings("text_for_number", "{h_s: fast}", "2:17",
               "settings.h_s: must be a number, such as 0.5 or 1e-4, not \"fast\""),
      settings("quoted_number", "{h_s: \"0.001\"}", "2:17", "settings.h_s: must be a number; remove the quotes"),
      settings("number_with_unit", "{h_s: 1ms}", "2:17", "must be a number without its unit, which is s, not \"1ms\""),
      settings("list_for_number", "{h_s: [1]}", "2:17", "settings.h_s: must be a number, not a list"),
      settings("h_zero", "{h_s: 0}", "2:17", "settings.h_s: must be at least 1e-06 and at most 0.1 s, not 0"),
      settings("h_negative", "{h_s: -0.001}", "2:17", "must be at least 1e-06"),
      settings("h_large", "{h_s: 0.5}", "2:17", "at most 0.1 s, not 0.5; did you mean 0.0005 (0.5 ms)?"),
      settings("h_nan", "{h_s: .nan}", "2:17", "must be a finite number"),
      settings("h_nan_word", "{h_s: nan}", "2:17", "must be a finite number"),
      settings("duration_infinite", "{duration_s: .inf}", "2:24", "settings.duration_s: must be a finite number"),
      settings("duration_overflows", "{duration_s: 1e999}", "2:24", "must be a finite number"),
      settings("ratio_zero", "{ratio: 0}", "2:19", "settings.ratio: must be at least 1 and at most 1000, not 0"),
      settings("ratio_large", "{ratio: 1001}", "2:19", "at most 1000, not 1001"),
      settings("ratio_three", "{ratio: [1, 2, 3]}", "2:19", "settings.ratio: must be a whole number, or the smallest"),
      settings("ratio_backwards", "{ratio: [8, 4]}", "2:23", "must be at least 8 and at most 1000, not 4"),
      settings("ratio_half", "{ratio: 2.5}", "2:19", "must be a whole number, not 2.5"),
      settings("settle_step", "{settle: {step_s: 0}}", "2:29", "settings.settle.step_s: must be at least"),
      settings("mode", "{mode: real_time}", "2:18",
               "settings.mode: unknown \"real_time\"; choose one of lockstep, realtime"),
      settings("scheme_empty", "{scheme: \"\"}", "2:20", "settings.scheme: must not be empty"),
      settings("preset", "{world: {preset: best}}", "2:28",
               "settings.world.preset: unknown \"best\"; choose one of fast, quality"),
      settings("engine_empty", "{world: {engine: \"\"}}", "2:28", "settings.world.engine: must not be empty"),
      settings("longest_substep", "{haptic: {longest_substep_s: 0}}", "2:40",
               "settings.haptic.longest_substep_s: must be at least 1e-05"),
      settings("iterations", "{haptic: {iterations: 0}}", "2:33", "settings.haptic.iterations: must be at least 1"),
      settings("too_many_users", "{users: 2}", "2:19", "settings.users: must be at most the 1 users"),
      settings("gravity_length", "{gravity_m_s2: [0, -9.81]}", "2:26",
               "settings.gravity_m_s2: must have 3 numbers, not 2"),
      settings("gravity_scalar", "{gravity_m_s2: 9.81}", "2:26", "must be a list of 3 numbers, not a single value"),
      settings("flag", "{paper: {device_force_in_world: yes}}", "2:43", "must be true or false, not \"yes\""),

      // Materials.
      material("friction_spelt", "{wood: {fricton: 0.5}}", "3:20",
               "materials.wood.fricton: unknown key; did you mean \"friction\"?"),
      material("friction_negative", "{wood: {friction: -0.1}}", "3:30", "materials.wood.friction: must be at least 0"),
      material("restitution_high", "{wood: {restitution: 1.1}}", "3:33",
               "materials.wood.restitution: must be at least 0 and at most 1, not 1.1"),
      material("restitution_negative", "{wood: {restitution: -1}}", "3:33", "at least 0"),
      material("material_twice", "{wood: {}, wood: {}}", "3:23", "materials.wood: stands twice"),

      // Bodies.
      body("mass_zero", "{name: c, shape: sphere, radius_m: 1, mass_kg: 0}", "5:52",
           "bodies[0].mass_kg: must be at least 1e-09"),
      body("mass_negative", "{name: c, shape: sphere, radius_m: 1, mass_kg: -1}", "5:52",
           "bodies[0].mass_kg: must be at least"),
      body("mass_missing", "{name: c, shape: sphere, radius_m: 1}", "5:5",
           "bodies[0]: one of mass_kg, density_kg_m3 is missing"),
      body("mass_and_density", "{name: c, shape: sphere, radius_m: 1, mass_kg: 1, density_kg_m3: 1}", "5:55",
           "bodies[0].density_kg_m3: must not stand here, \"mass_kg\" is already given"),
      body("fixed_with_mass", "{name: c, shape: sphere, radius_m: 1, mass_kg: 1, fixed: true}", "5:43",
           "must not stand here, the body is fixed"),
      body("radius_negative", "{name: c, shape: sphere, radius_m: -1, mass_kg: 1}", "5:40",
           "bodies[0].radius_m: must be at least 1e-06"),
      body("radius_missing", "{name: c, shape: sphere, mass_kg: 1}", "5:5", "\"radius_m\" is missing"),
      body("size_length", "{name: c, shape: box, size_m: [1, 1], mass_kg: 1}", "5:35",
           "bodies[0].size_m: must have 3 numbers, not 2"),
      body("size_item", "{name: c, shape: box, size_m: [1, x, 1], mass_kg: 1}", "5:39",
           "bodies[0].size_m[1]: must be a number"),
      body("size_of_a_sphere", "{name: c, shape: sphere, size_m: [1, 1, 1], radius_m: 1, mass_kg: 1}", "5:30",
           "a sphere has no such measure; remove it"),
      body("shape", "{name: c, shape: cube, mass_kg: 1}", "5:22", "unknown \"cube\"; choose one of sphere, box"),
      body("plane_moves", "{name: c, shape: plane, mass_kg: 1}", "5:22",
           "bodies[0].shape: a plane cannot move; add \"fixed: true\""),
      body("bin_moves", "{name: c, shape: bin, size_m: [1, 1, 1], wall_m: 1}", "5:22", "a bin cannot move"),
      body("mesh_moves", "{name: c, shape: mesh, file: open.obj, mass_kg: 1}", "5:34",
           "bodies[0].file: \"open.obj\" is not closed"),
      body("mesh_missing", "{name: c, shape: convex, file: none.stl, mass_kg: 1}", "5:36",
           "bodies[0].file: \"none.stl\" no such mesh file: "),
      body("mesh_open", "{name: c, shape: convex, file: open.obj, mass_kg: 1}", "5:36",
           "bodies[0].file: the surface is flat"),
      body("mesh_empty", "{name: c, shape: convex, file: empty.obj, mass_kg: 1}", "5:36",
           "bodies[0].file: \"empty.obj\""),
      body("mesh_flat", "{name: c, shape: convex, file: open.obj, fixed: true}", "5:36", "the surface is flat"),
      body("mesh_garbage", "{name: c, shape: mesh, file: garbage.stl, fixed: true}", "5:34",
           "\"garbage.stl\" cannot be read as a mesh"),
      body("unknown_material", "{name: c, shape: sphere, radius_m: 1, mass_kg: 1, material: wod}", "5:65",
           "unknown material \"wod\"; did you mean \"wood\"?"),
      body("belt_moves", "{name: c, shape: sphere, radius_m: 1, mass_kg: 1, surface_velocity_m_s: [1, 0, 0]}", "5:55",
           "only a fixed body has them"),
      body("pair_of_unknown",
           "{name: c, shape: sphere, radius_m: 1, mass_kg: 1}\npairs:\n  - {a: wood, b: wod, friction: 1}", "7:18",
           "pairs[0].b: unknown material \"wod\"; did you mean \"wood\"?"),
      body("pair_without_values", "{name: c, shape: sphere, radius_m: 1, mass_kg: 1}\npairs:\n  - {a: wood, b: wood}",
           "7:5", "pairs[0]: add friction, restitution"),
      body("pair_twice",
           "{name: c, shape: sphere, radius_m: 1, mass_kg: 1}\npairs:\n  - {a: wood, b: wood, friction: 1}\n  - {a: "
           "wood, b: wood, restitution: 1}",
           "8:5", "pairs[1]: these two materials are a pair already"),
      body("zero_axis", "{name: c, shape: sphere, radius_m: 1, mass_kg: 1, rotation: {axis: [0, 0, 0], angle_deg: 1}}",
           "5:72", "bodies[0].rotation.axis: must not be the zero vector"),
      body("angle_in_rad",
           "{name: c, shape: sphere, radius_m: 1, mass_kg: 1, rotation: {axis: [0, 0, 1], angle_rad: 1}}", "5:83",
           "did you mean \"angle_deg\"?"),
      body("slash_in_name", "{name: a/b, shape: sphere, radius_m: 1, mass_kg: 1}", "5:12", "\"a/b\" is not a name"),
      body("name_twice",
           "{name: c, shape: sphere, radius_m: 1, mass_kg: 1}\n  - {name: c, shape: sphere, radius_m: 1, mass_kg: 1}",
           "6:12", "bodies[1].name: there is another body \"c\""),
      body("position_nan", "{name: c, shape: sphere, radius_m: 1, mass_kg: 1, position_m: [0, .nan, 0]}", "5:71",
           "bodies[0].position_m[1]: must be a finite number"),
      body("position_unit", "{name: c, shape: sphere, radius_m: 1, mass_kg: 1, position_mm: 1}", "5:55",
           "did you mean \"position_m\"?"),

      // Groups.
      repeat("unknown_form", "{pile: {count: 2}}", "5:67", "bodies[0].repeat.pile: unknown key"),
      repeat("two_forms", "{stack: {count: 2}, row: {count: 2, step_m: [1, 0, 0]}}", "5:67",
             "must not stand here, \"row\" is already given"),
      repeat("count_zero", "{stack: {count: 0}}", "5:82", "bodies[0].repeat.stack.count: must be at least 1"),
      repeat("count_huge", "{stack: {count: 1000000000}}", "5:82", "at most 100000, not 1000000000"),
      repeat("grid_huge", "{grid: {counts: [1000, 1000, 1000], spacing_m: [1, 1, 1]}}", "5:73",
             "bodies[0].repeat.grid: 1000000000 bodies after 0 others; a scene has at most 100000"),
      {"full",
       Lines{.body =
                 "{name: c, shape: sphere, radius_m: 1, mass_kg: 1, repeat: {row: {count: 100000, step_m: [1, 1, 1]}}}"
                 "\n  - {name: d, shape: sphere, radius_m: 1, mass_kg: 1}",
             .proxy = "{body: c/0}"}
           .text(),
       "6:5", "bodies[1]: 1 bodies after 100000 others"},
      repeat("seed_missing", "{heap: {count: 2, area_m: [3, 3]}}", "5:73", "\"seed\" is missing"),
      repeat("seed_negative", "{heap: {count: 2, area_m: [3, 3], seed: -1}}", "5:106", "seed: must be at least 0"),
      repeat("area_small", "{heap: {count: 2, area_m: [1, 1], seed: 1}}", "5:73", "not one body fits area_m"),
      repeat("card_too_thick", "{card_house: {stages: 3}}", "5:79", "neighbouring pairs overlap"),
      repeat("stage_zero", "{card_house: {stages: 0}}", "5:88", "stages: must be at least 1"),

      // Users.
      proxy("unknown_proxy", "{body: cubes}", "8:19",
            "users[0].proxy.body: no body is named \"cubes\"; did you mean \"cube\"?"),
      proxy("proxy_with_both", "{body: cube, mass_kg: 1}", "8:25", "users[0].proxy.mass_kg: must not stand here"),
      proxy("proxy_plane", "{shape: plane, mass_kg: 1}", "8:20", "a plane cannot move"),
      proxy("proxy_bin", "{shape: bin, mass_kg: 1}", "8:20", "a bin cannot be a proxy"),
      proxy("proxy_fixed_key", "{shape: sphere, radius_m: 1, fixed: true}", "8:41",
            "users[0].proxy.fixed: unknown key"),
      {"proxy_fixed_body", Lines{.body = "{name: f, shape: plane, fixed: true}", .proxy = "{body: f}"}.text(), "8:19",
       "\"f\" is fixed, a proxy must move"},
      {"proxy_shared", Lines{.proxy = "{body: cube}", .more = "  - {name: other, proxy: {body: cube}}\n"}.text(),
       "10:26", "users[1].proxy: is the proxy of \"hand\" already"},
      more("user_twice", "  - {name: hand, proxy: {body: cube}}\n", "10:12", "there is another user \"hand\""),
      more("box_zero", "    box_half_m: 0\n", "10:17", "users[0].box_half_m: must be above 0"),
      more("selection_unknown", "    selection: sphere\n", "10:16", "choose one of box, contacts, budget"),
      more("selection_shallow", "    selection: contacts\n", "10:16", "needs contact_depth"),
      more("budget_zero", "    budget_ratio: 0\n", "10:19", "users[0].budget_ratio: must be above 0"),
      more("coupling_negative", "    coupling: {stiffness_n_m: -1}\n", "10:31",
           "users[0].coupling.stiffness_n_m: must be above 0"),
      more("coupling_unit", "    coupling: {stiffness: 1}\n", "10:16", "did you mean \"stiffness_n_m\"?"),

      // Devices and paths.
      device("device_kind", "{kind: magic}", "9:20", "unknown \"magic\"; choose one of impedance, admittance"),
      device("freedom_four", "{degrees_of_freedom: 4}", "9:34",
             "users[0].device.degrees_of_freedom: must be 3 (translations) or 6, not 4"),
      device("rate_zero", "{rate_hz: 0}", "9:23", "rate_hz: must be at least 1"),
      device("operator_mass", "{operator: {mass_kg: 0}}", "9:34", "users[0].device.operator.mass_kg: must be above 0"),
      path("move_backwards", "{move: [1, 0, 0], during_s: [2, 1]}", "9:49",
           "users[0].device.path[0].during_s: must end after it begins, not [2, 1]"),
      path("move_at_once", "{move: [1, 0, 0], during_s: [1, 1]}", "9:49", "must end after it begins"),
      path("move_without_time", "{move: [1, 0, 0]}", "9:21", "users[0].device.path[0]: \"during_s\" is missing"),
      path("move_before_start", "{move: [1, 0, 0], during_s: [-1, 1]}", "9:50", "during_s[0]: must be at least 0"),
      path("move_again_too_soon", "{move: [1, 0, 0], during_s: [0, 2], every_s: 1}", "9:66",
           "path[0].every_s: must be at least the 2 s that the segment takes, not 1"),
      path("circle_again", "{circle: {radius_m: 1, period_s: 1}, every_s: 1}", "9:58", "must not stand here"),
      path("circle_period_zero", "{circle: {radius_m: 1, period_s: 0}}", "9:54",
           "path[0].circle.period_s: must be at least 0.001"),
      path("circle_backwards", "{circle: {radius_m: 1, period_s: 1}, from_s: 2, to_s: 1}", "9:75",
           "must be after from_s, 2, not 1"),
      path("no_form", "{during_s: [0, 1]}", "9:21", "one of move, turn, circle, wave is missing"),
      path("turn_of_three", "{turn: {axis: [0, 0, 1], angle_deg: 5}, during_s: [0, 1]}", "9:21",
           "a device with 3 degrees of freedom does not turn"),
      path("wave_ends", "{wave: {along: [1, 0, 0], across: [0, 1, 0], amplitude_m: 1, wavenumber_rad_m: 1}, to_s: 2}",
           "9:104", "must not stand here, a wave lasts as long as its path"),
  };
}

class BrokenScene : public testing::TestWithParam<Broken> {};

TEST_P(BrokenScene, IsRefusedWithPlaceKeyAndCure) {
  const TemporaryFolder folder;
  folder.write("open.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n");
  folder.write("empty.obj", "");
  folder.write("garbage.stl", "this is no mesh");
  const std::string message = refusal(folder.write("scene.yaml", GetParam().text), folder.path());
  EXPECT_TRUE(message.starts_with(fmt::format("scene.yaml:{}: ", GetParam().place))) << message;
  EXPECT_NE(message.find(GetParam().fragment), std::string::npos) << message;
  EXPECT_NE(message.find_first_of(";?,"), std::string::npos) << message;
  EXPECT_EQ(message.find('\n'), std::string::npos) << "one error is listed once, without consequences: " << message;
}

INSTANTIATE_TEST_SUITE_P(Table, BrokenScene, testing::ValuesIn(broken_scenes()),
                         [](const auto& at) { return std::string(at.param.label); });

TEST(SceneFile, TheTableStartsFromASceneThatLoads) { EXPECT_NO_THROW((void)load_text(Lines{}.text())); }

TEST(SceneFile, MissingFileDirectoryAndDeviceAreNamed) {
  const TemporaryFolder folder;
  EXPECT_EQ(refusal(folder.path() + "/none.yaml", folder.path()),
            "none.yaml: no such file; give the path of a scene, e.g. deploy/scenes/row.yaml");
  EXPECT_NE(refusal(folder.path(), "").find("is a directory"), std::string::npos);
  EXPECT_NE(refusal("/dev/zero", "").find("is not a regular file"), std::string::npos);
}

TEST(SceneFile, UnreadableFileIsNamed) {
  const TemporaryFolder folder;
  const std::string file = folder.write("secret.yaml", "name: x\n");
  ASSERT_EQ(chmod(file.c_str(), 0), 0);
  ASSERT_EQ(chmod(folder.path().c_str(), 0755), 0);
  const uid_t me = geteuid();
  ASSERT_EQ(seteuid(me == 0 ? 65534 : me), 0);  // root can read everything, nobody cannot
  const std::string message = refusal(file, folder.path());
  ASSERT_EQ(seteuid(me), 0);
  EXPECT_NE(message.find("cannot be read"), std::string::npos) << message;
}

TEST(SceneFile, LargeFileIsRefusedUnread) {
  const TemporaryFolder folder;
  const std::string file = folder.write("large.yaml", "name: x\n");
  std::filesystem::resize_file(file, 17U << 20U);
  EXPECT_NE(refusal(file, folder.path()).find("is larger than 16 MB"), std::string::npos);
}

/// More than any memory holds: they are counted before they are made.
TEST(SceneFile, TooManyBodiesAreRefused) {
  Lines lines;
  lines.body =
      "{name: c, shape: sphere, radius_m: 1, mass_kg: 1, repeat: {grid: {counts: [100000, 100000, 100000], "
      "spacing_m: [1, 1, 1]}}}";
  const TemporaryFolder folder;
  EXPECT_NE(refusal(folder.write("s.yaml", lines.text()), folder.path()).find("1000000000000000 bodies"),
            std::string::npos);
}

/// With any byte replaced, the file loads or is refused: no other exception and no crash.
TEST(SceneFile, DamagedFilesAreRefusedOrLoad) {
  const std::string whole = Lines{}.text();
  const TemporaryFolder folder;
  int refused = 0;
  for (std::size_t i = 0; i < whole.size(); ++i) {
    for (const char c : {'\0', ':', '{', ']', '-', '\n', '\t', '"', '&', '%', '9', '\xff'}) {
      std::string text = whole;
      text[i] = c;
      refused += refusal(folder.write("s.yaml", text), folder.path()).empty() ? 0 : 1;
    }
  }
  EXPECT_GT(refused, 1000);
}

}  // namespace
}  // namespace subworld
