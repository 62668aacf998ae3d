#include "model/scene/scene.hpp"
#include "model/scene/scene_reader.hpp"

#include <fmt/core.h>

#include <charconv>

namespace subworld {

std::optional<RatioBounds> parse_ratio(std::string_view text) {
  RatioBounds ratio;
  const char* const end = text.data() + text.size();
  const auto least = std::from_chars(text.data(), end, ratio.least);
  if (least.ec != std::errc{}) return std::nullopt;
  ratio.most = ratio.least;
  if (least.ptr != end) {
    if (*least.ptr != '-') return std::nullopt;
    const auto most = std::from_chars(least.ptr + 1, end, ratio.most);
    if (most.ec != std::errc{} || most.ptr != end) return std::nullopt;
  }
  if (ratio.least < 1 || ratio.most < ratio.least || ratio.most > kMostRatio) return std::nullopt;
  return ratio;
}

std::string to_text(const RatioBounds& ratio) {
  return ratio.most > ratio.least ? fmt::format("{}-{}", ratio.least, ratio.most) : fmt::format("{}", ratio.least);
}

Scene load_scene(const std::string& file) {
  const YamlNode root = read_yaml(file);
  Faults faults;
  const YamlMap map({file, "", root, root.mark},
                    {"name", "description", "settings", "materials", "pairs", "bodies", "joints", "users"}, faults);
  Scene scene;
  scene.file = file;
  faults.collect([&] { scene.name = map.at("name").name(); });
  faults.collect([&] { map.read("description", scene.description); });
  faults.collect([&] {
    UserSpec none;
    if (const auto settings = map.find("settings")) read_settings(*settings, "", scene.settings, none);
  });
  Materials materials;
  const bool named = faults.collect([&] {
    if (const auto value = map.find("materials")) materials = read_materials(*value, faults);
  });
  if (!named) faults.raise();  // else each use of a material would be an error
  faults.collect([&] {
    if (const auto pairs = map.find("pairs"))
      scene.settings.world.pairs = scene.settings.haptic.pairs = read_pairs(*pairs, materials);
  });
  BodyReader bodies(scene, std::move(materials));
  const bool complete = faults.collect([&] { bodies.read_bodies(map.at("bodies")); });
  faults.collect([&] {
    if (const auto joints = map.find("joints"); joints && complete) JointReader(scene, bodies).read(*joints);
  });
  faults.collect([&] { read_users(map.at("users"), bodies, scene); });
  faults.raise();
  if (scene.settings.users > static_cast<int>(scene.users.size())) {
    YamlMap(map.at("settings"), keys_in(""))
        .at("users")
        .fail(fmt::format("must be at most the {} users that the scene lists, not {}", scene.users.size(),
                          scene.settings.users));
  }
  return scene;
}

}  // namespace subworld
