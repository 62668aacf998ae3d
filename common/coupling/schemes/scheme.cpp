#include "coupling/schemes/scheme.hpp"

#include "coupling/schemes/direct/direct.hpp"
#include "coupling/schemes/paper/paper.hpp"
#include "coupling/schemes/reduced/reduced.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"
#include "model/shapes/nearest.hpp"

#include <fmt/core.h>

#include <vector>

namespace subworld {

namespace {

std::vector<const Scheme*>& table() {
  static std::vector<const Scheme*> rows{&kDirect, &kPaper, &kReduced};
  return rows;
}

}  // namespace

std::span<const Scheme* const> schemes() { return table(); }

void add_scheme(const Scheme& scheme) {
  const std::string_view name = scheme.properties.name;
  const auto refuse = [&](const std::string& why) {
    throw Error(ExitCode::usage, fmt::format("scheme \"{}\": {}", name, why));
  };
  if (name.empty()) refuse("give it a name: properties.name");
  for (const Scheme* one : table())
    if (one->properties.name == name) refuse("there is one of this name already; choose another");
  const bool lacks_side = scheme.properties.has_sub_worlds && scheme.make_sub_world_side == nullptr;
  if (scheme.correction == nullptr || scheme.make_world_side == nullptr || lacks_side)
    refuse("correction, make_world_side and make_sub_world_side are functions; one is missing");
  table().push_back(&scheme);
}

const Scheme& scheme_of(const Settings& settings, std::string_view where) {
  std::vector<std::string_view> known;
  for (const Scheme* scheme : schemes()) {
    if (scheme->properties.name == settings.scheme) return *scheme;
    known.push_back(scheme->properties.name);
  }
  const std::string_view near = nearest(settings.scheme, known);
  throw Error(ExitCode::usage,
              fmt::format("{}: there is no scheme \"{}\"; choose one of {}{}", where, settings.scheme,
                          joined(known, ", "), near.empty() ? "" : fmt::format("; did you mean {}?", near)));
}

}  // namespace subworld
