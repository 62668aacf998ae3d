#include "launch.hpp"
#include "model/error.hpp"
#include "physics/engine.hpp"
#include "physics/plugin.hpp"
#include "wire/plugin.hpp"

#include <fmt/format.h>

namespace subworld {

std::string part_versions() {
  std::string text;
  for (const std::string& name : engine_names()) {
    std::string version = "cannot be loaded";
    try {
      version = engine_plugin(name).version;
    } catch (const Error&) {
      // A run with this engine reports the cause.
    }
    text += fmt::format("engine {}: {}\n", name, version);
  }
  for (const Vendor vendor : {Vendor::fastdds, Vendor::cyclonedds}) {
    const std::string version = wire::installed_version(vendor);
    text += fmt::format("DDS {}: {}\n", name_of(vendor), version.empty() ? "not installed" : version);
  }
  if (text.ends_with('\n')) text.pop_back();
  return text;
}

}  // namespace subworld
