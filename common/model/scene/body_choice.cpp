#include "model/scene/body_choice.hpp"

#include "model/error.hpp"
#include "model/shapes/nearest.hpp"

#include <fmt/core.h>
#include <fnmatch.h>

#include <algorithm>
#include <ranges>
#include <set>
#include <string>

namespace subworld {

namespace {

constexpr std::string_view kAll = "all";

/// Suggestions for an unknown word: the groups of repeated bodies as "name/*", then every body.
std::vector<std::string> known_words(const Scene& scene) {
  std::vector<std::string> words{std::string(kAll)};
  std::set<std::string> groups;
  for (const Body& body : scene.bodies) {
    const std::size_t slash = body.name.find('/');
    if (slash == std::string::npos) continue;
    const std::string group = body.name.substr(0, slash) + "/*";
    if (groups.insert(group).second) words.push_back(group);
  }
  for (const Body& body : scene.bodies) words.push_back(body.name);
  return words;
}

[[noreturn]] void refuse(const Scene& scene, std::string_view word) {
  const std::vector<std::string> words = known_words(scene);
  std::string_view near = nearest(word, {words.begin(), words.end()});
  const auto longer = std::ranges::find_if(words, [&](const std::string& known) { return known.ends_with(word); });
  if (near.empty() && !word.empty() && longer != words.end()) near = *longer;  // "proxy" for "hand/proxy"
  throw Error(ExitCode::usage, fmt::format("--bodies: no body of {} is named \"{}\"; {}", scene.name, word,
                                           near.empty() ? "give names of the scene, patterns such as cube*, or all"
                                                        : fmt::format("did you mean \"{}\"?", near)));
}

}  // namespace

bool matches(const std::string& pattern, const std::string& name) noexcept {
  return fnmatch(pattern.c_str(), name.c_str(), FNM_NOESCAPE) == 0;
}

std::vector<BodyId> choose_bodies(const Scene& scene, std::string_view list) {
  std::vector<bool> chosen(scene.bodies.size(), false);
  if (list.empty()) refuse(scene, list);
  for (const auto item : std::views::split(list, ',')) {
    const std::string word(item.begin(), item.end());
    bool known = false;
    for (const Body& body : scene.bodies) {
      const bool meant = word == kAll ? !body.fixed() : matches(word, body.name);
      if (meant) known = chosen[index(body.id)] = true;
    }
    if (!known) refuse(scene, word);
  }
  std::vector<BodyId> bodies;
  for (const Body& body : scene.bodies) {
    if (chosen[index(body.id)]) bodies.push_back(body.id);
  }
  return bodies;
}

}  // namespace subworld
