#include "coupling/scheme.hpp"

#include "coupling/direct/direct.hpp"
#include "coupling/paper/paper.hpp"
#include "coupling/reduced/reduced.hpp"
#include "model/error.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <vector>

namespace subworld {

namespace {

std::vector<const Scheme*>& table() {
  static std::vector<const Scheme*> rows{&kDirect, &kPaper, &kReduced};
  return rows;
}

}  // namespace

std::span<const Scheme* const> schemes() { return table(); }

void add_scheme(const Scheme& scheme) { table().push_back(&scheme); }

const Scheme& scheme_of(const Settings& settings) {
  std::string known;
  for (const Scheme* scheme : schemes()) {
    if (scheme->properties.name == settings.scheme) return *scheme;
    known += fmt::format("{}{}", known.empty() ? "" : ", ", scheme->properties.name);
  }
  throw Error(ExitCode::usage, fmt::format("scheme \"{}\" is unknown; choose one of: {}", settings.scheme, known));
}

}  // namespace subworld
