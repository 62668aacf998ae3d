#include "model/saving.hpp"

#include "model/error.hpp"
#include "model/nearest.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace subworld {

Kept parse_kept(const std::vector<std::string>& names) {
  std::vector<std::string_view> known{"all"};
  for (const SavingName& one : kSavings) known.push_back(one.name);
  Kept set = kKeepNothing;
  for (const std::string& name : names) {
    const auto found = std::ranges::find(kSavings, name, &SavingName::name);
    if (found == kSavings.end() && name != "all") {
      const std::string_view meant = nearest(name, known);
      throw Error(ExitCode::usage, fmt::format("--keep: there is no item \"{}\"; {}choose of: {}", name,
                                               meant.empty() ? "" : fmt::format("did you mean {}? Else ", meant),
                                               fmt::join(known, ", ")));
    }
    set |= name == "all" ? kKeepAll : kept(found->saving);
  }
  return set;
}

std::vector<std::string_view> kept_names(Kept set) {
  std::vector<std::string_view> names;
  for (const SavingName& one : kSavings) {
    if ((set & kept(one.saving)) != 0) names.push_back(one.name);
  }
  return names;
}

}  // namespace subworld
