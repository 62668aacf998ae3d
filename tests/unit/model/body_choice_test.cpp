// The choice of bodies by --bodies.
#include "model/scene/body_choice.hpp"

#include "model/error.hpp"

#include <gtest/gtest.h>

#include <string>

namespace subworld {
namespace {

Scene scene_of(const std::vector<std::string>& names) {
  Scene scene;
  scene.name = "shelf";
  for (const std::string& name : names) {
    Body& body = scene.bodies.emplace_back();
    body.id = static_cast<BodyId>(scene.bodies.size() - 1);
    body.name = name;
    body.mass = name.starts_with("floor") || name.starts_with("bin") ? 0.0 : 1.0;
  }
  return scene;
}

const Scene& shelf() {
  static const Scene kShelf =
      scene_of({"floor", "bin/0", "bin/1", "cube/0", "cube/1", "cube/10", "cubes", "ball", "hand/proxy"});
  return kShelf;
}

std::string chosen(std::string_view list) {
  std::string names;
  for (const BodyId id : choose_bodies(shelf(), list)) names += (names.empty() ? "" : " ") + shelf().body(id).name;
  return names;
}

std::string refusal_of(std::string_view list) {
  try {
    (void)choose_bodies(shelf(), list);
  } catch (const Error& wrong) {
    EXPECT_EQ(wrong.code(), ExitCode::usage);
    return wrong.what();
  }
  return "accepted";
}

TEST(BodyChoice, TakesNamesInTheOrderOfTheSceneAndOnce) {
  EXPECT_EQ(chosen("ball"), "ball");
  EXPECT_EQ(chosen("ball,cube/1,ball"), "cube/1 ball");
  EXPECT_EQ(chosen("floor"), "floor");
}

TEST(BodyChoice, TakesPatterns) {
  EXPECT_EQ(chosen("cube*"), "cube/0 cube/1 cube/10 cubes");
  EXPECT_EQ(chosen("cube/*"), "cube/0 cube/1 cube/10");
  EXPECT_EQ(chosen("cube/?"), "cube/0 cube/1");
  EXPECT_EQ(chosen("*/1*,cube/1"), "bin/1 cube/1 cube/10");
  EXPECT_EQ(chosen("*/proxy"), "hand/proxy");
  EXPECT_EQ(chosen("bin*"), "bin/0 bin/1") << "fixed bodies can be named";
}

TEST(BodyChoice, AllAreThoseThatCanMove) {
  EXPECT_EQ(chosen("all"), "cube/0 cube/1 cube/10 cubes ball hand/proxy");
  EXPECT_EQ(chosen("all,floor"), "floor cube/0 cube/1 cube/10 cubes ball hand/proxy");
}

TEST(BodyChoice, AWrongNameIsAnsweredWithTheNearest) {
  const auto answers = [](std::string_view list, const std::string& near) {
    const std::string said = refusal_of(list);
    EXPECT_NE(said.find("--bodies"), std::string::npos) << said;
    EXPECT_NE(said.find("shelf"), std::string::npos) << said;
    EXPECT_NE(said.find(near), std::string::npos) << said;
  };
  answers("bal", "did you mean \"ball\"?");
  answers("bin", "did you mean \"bin/*\"?");
  answers("ball,cube/2", "named \"cube/2\"; did you mean \"cube/");
  answers("proxy", "did you mean \"hand/proxy\"?");
  answers("sphere*", "patterns such as cube*");
  answers("", "named \"\"");
  answers("ball,", "named \"\"");
}

TEST(BodyChoice, APatternMatchesFromEndToEnd) {
  EXPECT_TRUE(matches("*", ""));
  EXPECT_TRUE(matches("a*b*c", "aXbXbYc"));
  EXPECT_TRUE(matches("*ab", "aab"));
  EXPECT_TRUE(matches("a**", "a"));
  EXPECT_FALSE(matches("a*b", "abc"));
  EXPECT_FALSE(matches("a?", "a"));
  EXPECT_FALSE(matches("", "a"));
  EXPECT_FALSE(matches("cube", "cube/0"));
}

}  // namespace
}  // namespace subworld
