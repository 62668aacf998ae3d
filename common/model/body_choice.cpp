#include "model/body_choice.hpp"

#include "model/error.hpp"
#include "model/nearest.hpp"

#include <fmt/format.h>

#include <algorithm>
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

bool matches(std::string_view pattern, std::string_view name) noexcept {
  std::size_t p = 0, n = 0;
  std::size_t star = std::string_view::npos, taken = 0;  // the last `*`, and the end of the text that it matched
  while (n < name.size()) {
    if (p < pattern.size() && pattern[p] == '*') {
      star = p++;
      taken = n;
    } else if (p < pattern.size() && (pattern[p] == '?' || pattern[p] == name[n])) {
      ++p;
      ++n;
    } else if (star != std::string_view::npos) {
      p = star + 1;
      n = ++taken;
    } else {
      return false;
    }
  }
  return pattern.find_first_not_of('*', p) == std::string_view::npos;
}

std::vector<BodyId> choose_bodies(const Scene& scene, std::string_view list) {
  std::vector<bool> chosen(scene.bodies.size(), false);
  for (std::size_t begin = 0; begin <= list.size();) {
    const std::size_t end = std::min(list.find(',', begin), list.size());
    const std::string_view word = list.substr(begin, end - begin);
    begin = end + 1;
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
