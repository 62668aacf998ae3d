#include "support/scene_text.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <ranges>
#include <string>
#include <vector>

namespace subworld {
namespace {

/// The keys of a message's lines.
std::vector<std::string> keys_of(const std::string& message) {
  std::vector<std::string> keys;
  for (const auto line : std::views::split(message, '\n')) {
    const std::string text(line.begin(), line.end());
    const std::size_t key = text.find(": ") + 2;
    keys.push_back(text.substr(key, text.find(": ", key) - key));
  }
  return keys;
}

TEST(SceneErrors, AreAllListedEachWithItsPlace) {
  const TemporaryFolder folder;
  const std::string message = refusal(folder.write("scene.yaml", R"(name: broken
settings: {h_s: fast, ratoi: 4, world: {substeps: 0}}
materials: {wood: {friction: -1}}
bodies:
  - {name: cube, shape: box, size_m: [1, 1], mass_kg: -1, material: wod, positoin_m: [0, 0, 0]}
users:
  - name: operator
    proxy: {body: cubes}  # perhaps the name of a body whose error hides it
    device: {rate_hz: -5, path: [{move: [1, 0, 0], during_s: [1, 0]}]}
colour: red
)"),
                                      folder.path());
  EXPECT_EQ(keys_of(message),
            (std::vector<std::string>{"colour", "settings.ratoi", "settings.h_s", "settings.world.substeps",
                                      "materials.wood.friction", "bodies[0].positoin_m", "bodies[0].size_m",
                                      "bodies[0].material", "bodies[0].mass_kg", "users[0].device.rate_hz",
                                      "users[0].device.path[0].during_s"}))
      << message;
}

TEST(SceneErrors, OfPairsAndOfTheWayToDivideAMeshAreAllListed) {
  const TemporaryFolder folder;
  const std::string message = refusal(folder.write("scene.yaml", R"(name: broken
materials: {wood: {friction: 1}}
pairs:
  - {a: wod, b: iron, friction: -1, restitutoin: 0, rolling_friction_m: none}
  - {a: wood, b: wood}
  - {a: wood, b: wood, friction: 1}
bodies:
  - {name: cup, shape: mesh, scale: 0, mass_kg: 1, decompose: {concavity_m: 0, most_parts: 0, parts: 3, kind: fine}}
users: [{name: operator, proxy: {shape: sphere, radius_m: 1, mass_kg: 1}}]
)"),
                                      folder.path());
  EXPECT_EQ(keys_of(message),
            (std::vector<std::string>{"pairs[0].restitutoin", "pairs[0].a", "pairs[0].b", "pairs[0].friction",
                                      "pairs[0].rolling_friction_m", "pairs[1]", "bodies[0]",
                                      "bodies[0].decompose.parts", "bodies[0].decompose.kind",
                                      "bodies[0].decompose.concavity_m", "bodies[0].decompose.most_parts"}))
      << message;
}

TEST(SceneErrors, OfALargeFileAreListedUpToTwenty) {
  std::string text = "name: broken\nbodies:\n";
  for (int i = 0; i < 30; ++i) text += "  - {name: cube, shape: ball, mass_kg: 1}\n";
  text += "users: [{name: operator, proxy: {shape: sphere, radius_m: 1, mass_kg: 1}}]\n";
  const TemporaryFolder folder;
  const std::string message = refusal(folder.write("scene.yaml", text), folder.path());
  EXPECT_EQ(std::ranges::count(message, '\n'), 20) << message;
  EXPECT_NE(message.find("only the first 20 errors are listed"), std::string::npos) << message;
}

}  // namespace
}  // namespace subworld
