#include "io/ending.hpp"

#include "io/results/json.hpp"

#include <fmt/core.h>

#include <unistd.h>

#include <array>
#include <cstring>

namespace subworld {

void to_json(Json& json, const Ending& ending) {
  json = {{"session", fmt::format("{:016x}", ending.session)},
          {"from_s", ending.from_s},
          {"to_s", ending.to_s},
          {"by", ending.by},
          {"fault", ending.fault}};
}

void from_json(const Json& json, Ending& ending) {
  ending = {.session = std::stoull(json.at("session").get<std::string>(), nullptr, 16),
            .from_s = json.at("from_s"),
            .to_s = json.at("to_s"),
            .by = json.at("by"),
            .fault = json.at("fault")};
}

std::string host_name() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "unknown";
}

std::string name_of_signal(int signal) {
  const char* name = sigabbrev_np(signal);
  return name != nullptr ? fmt::format("SIG{}", name) : fmt::format("signal {}", signal);
}

}  // namespace subworld
