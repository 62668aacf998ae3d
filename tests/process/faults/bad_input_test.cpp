#include "process/process_test.hpp"

#include <regex>

namespace subworld::test {
namespace {

/// A complete scene with one line replaced.
struct Lines {
  std::string name = "name: broken";
  std::string settings = "settings: {h_s: 0.001, duration_s: 0.1}";
  std::string body = "{name: cube, shape: box, size_m: [0.1, 0.1, 0.1], mass_kg: 0.2, position_m: [0, 0, 0.05]}";
  std::string users =
      "users: [{name: hand, proxy: {shape: sphere, radius_m: 0.03, mass_kg: 0.1, position_m: [1, 0, 0]}}]";
  std::string more = "";

  [[nodiscard]] std::string text() const {
    return name + "\n" + settings + "\nbodies:\n  - " + body + "\n" + users + "\n" + more;
  }
};

struct Broken {
  std::string label;
  std::string text;
  std::string says;  ///< part of the message
};

std::string body(const std::string& rest) { return Lines{.body = "{name: cube, " + rest + "}"}.text(); }
std::string settings(const std::string& inside) { return Lines{.settings = "settings: {" + inside + "}"}.text(); }
std::string user(const std::string& rest) {
  return Lines{.users = "users: [{name: hand, proxy: {shape: sphere, radius_m: 0.03, mass_kg: 0.1}, " + rest + "}]"}
      .text();
}

std::vector<Broken> broken_scenes() {
  const std::string box = "shape: box, size_m: [0.1, 0.1, 0.1], ";
  return {
      {"unknown key", settings("h_s: 0.001, durration_s: 1"), "duration_s"},
      {"unknown section", Lines{.more = "bodys: []\n"}.text(), "bodies"},
      {"wrong type", settings("h_s: fast"), "h_s"},
      {"text for a vector", body("shape: box, size_m: large, mass_kg: 1"), "size_m"},
      {"two numbers for three", body("shape: box, size_m: [1, 2], mass_kg: 1"), "size_m"},
      {"not a number", body(box + "mass_kg: .nan"), "mass_kg"},
      {"infinite", body(box + "mass_kg: .inf"), "mass_kg"},
      {"infinite place", body(box + "mass_kg: 1, position_m: [0, .inf, 0]"), "position_m"},
      {"negative mass", body(box + "mass_kg: -0.2"), "mass_kg"},
      {"no mass", body("shape: box, size_m: [0.1, 0.1, 0.1]"), "mass_kg"},
      {"flat box", body("shape: box, size_m: [0.1, 0.1, 0], mass_kg: 1"), "size_m"},
      {"unknown shape", body("shape: cone, mass_kg: 1"), "shape"},
      {"unknown material", body(box + "mass_kg: 1, material: wool"), "material"},
      {"missing mesh", body("shape: convex, file: nowhere.obj, mass_kg: 1"), "nowhere.obj"},
      {"a mesh that is none", body("shape: convex, file: scene.yaml, mass_kg: 1"), "scene.yaml"},
      {"one name twice",
       Lines{.body = "{name: cube, " + box + "mass_kg: 1}\n  - {name: cube, " + box + "mass_kg: 1}"}.text(), "cube"},
      {"a thousand million bodies", body(box + "mass_kg: 1, repeat: {row: {count: 1000000000, step_m: [1, 0, 0]}}"),
       "count"},
      {"too many bodies on a grid",
       body(box + "mass_kg: 1, repeat: {grid: {counts: [1000, 1000, 1000], spacing_m: [1, 1, 1]}}"), "at most 100000"},
      {"no user", Lines{.users = "users: []"}.text(), "user"},
      {"no users", Lines{.users = ""}.text(), "users"},
      {"more users than declared", settings("users: 3"), "users"},
      {"proxy without a body", Lines{.users = "users: [{name: hand, proxy: {body: ghost}}]"}.text(), "ghost"},
      {"negative stiffness", user("coupling: {stiffness_n_m: -1}"), "stiffness_n_m"},
      {"a path back in time", user("device: {path: [{move: [1, 0, 0], during_s: [2, 1]}]}"), "during_s"},
      {"step of nothing", settings("h_s: 0"), "h_s"},
      {"ratio of nothing", settings("ratio: 0"), "ratio"},
      {"unknown mode", settings("mode: fast"), "mode"},
      {"unknown scheme", settings("scheme: papers"), "paper"},
      {"duplicate key", settings("h_s: 0.001, h_s: 0.002"), "h_s"},
      {"empty file", "", ""},
      {"a comment only", "# nothing\n", ""},
      {"not YAML", "name: [broken\nbodies: }\n", ""},
      {"a list", "- name: broken\n", ""},
      {"binary",
       std::string("\x7f"
                   "ELF\x02\x01\0\0\xff\xfe",
                   10),
       ""},
      {"an anchor", Lines{.name = "name: &a broken"}.text(), ""},
      {"deep", std::string(20000, '['), ""},
  };
}

class BadScene : public ProcessTest {};

TEST_F(BadScene, IsRefusedWithItsPlace) {
  const std::regex place(R"(subworld: error: .*/scene\.yaml:(\d+:\d+:)? )");
  for (const Broken& one : broken_scenes()) {
    SCOPED_TRACE(one.label);
    const Ended ended = run(folder_.write("scene.yaml", one.text), {});
    EXPECT_EQ(ended.code, 2) << ended.err;
    EXPECT_TRUE(std::regex_search(ended.err, place)) << ended.err;
    EXPECT_NE(ended.err.find(one.says), std::string::npos) << ended.err;
    EXPECT_LT(ended.err.size(), 600U) << "a message, not a page";
    EXPECT_FALSE(std::filesystem::exists(out() + "/logs")) << "programs were started";
  }
}

/// Each fault above must come from the replaced line only.
TEST_F(BadScene, IsGoodUntilItsLineIsReplaced) {
  const Ended ended = run(folder_.write("scene.yaml", Lines{}.text()), {});
  EXPECT_EQ(ended.code, 0) << ended.err;
}

TEST_F(BadScene, IsRefusedWhereItIsNoFile) {
  for (const std::string& path : {folder_.path() + "/nowhere.yaml", folder_.path(), std::string("/dev/null")}) {
    SCOPED_TRACE(path);
    const Ended ended = run(path, {});
    EXPECT_EQ(ended.code, 2);
    EXPECT_NE(ended.err.find(path + ":"), std::string::npos) << ended.err;
  }
}

}  // namespace
}  // namespace subworld::test
