#include "io/ending.hpp"

#include "model/error.hpp"

#include <fmt/format.h>

#include <cstring>

namespace subworld {

Json to_json(const Ending& ending) {
  return {{"session", fmt::format("{:016x}", ending.session)},
          {"from_s", ending.from_s},
          {"to_s", ending.to_s},
          {"by", ending.by},
          {"fault", ending.fault}};
}

void conclude(const std::string& path, Json part, const Ending& ending) {
  part["ending"] = to_json(ending);
  if (!path.empty()) write_json(path, part);
  if (!ending.fault.empty()) throw Error(ExitCode::failed, ending.fault);
}

std::string name_of_signal(int signal) {
  const char* name = sigabbrev_np(signal);
  return name != nullptr ? fmt::format("SIG{}", name) : fmt::format("signal {}", signal);
}

}  // namespace subworld
