#include "device_sim/drivers.hpp"

#include "model/error.hpp"
#include "model/joined.hpp"
#include "model/shapes/nearest.hpp"
#include "plugin/library.hpp"

#include <fmt/core.h>

namespace subworld {

namespace {

constexpr PluginKind kDrivers{.noun = "device driver",
                              .with_article = "a device driver",
                              .prefix = "libsubworld_device_",
                              .folders_variable = "SUBWORLD_DEVICES",
                              .entry = "subworld_driver_plugin",
                              .interface = kDriverPluginInterface,
                              .page = "device_sim/README.md"};

}  // namespace

std::vector<std::string> driver_names() { return plugin_names(kDrivers); }

const DriverPlugin& driver_plugin(std::string_view name) {
  const auto files = plugin_files(kDrivers);
  if (const auto file = files.find(name); file != files.end())
    return *static_cast<const DriverPlugin*>(load_plugin(kDrivers, file->first, file->second));
  std::vector<std::string> names = driver_names();
  names.insert(names.begin(), std::string(kEmulated));
  const std::string_view meant = nearest(name, {names.begin(), names.end()});
  throw Error(
      ExitCode::usage,
      fmt::format("device \"{}\" is unknown; {}choose one of: {}; SUBWORLD_DEVICES names folders with further "
                  "drivers",
                  name, meant.empty() ? "" : fmt::format("did you mean {}? Else ", meant), joined(names, ", ")));
}

std::string refused_in_lockstep(std::string_view name) {
  return fmt::format(
      "--device {}: a real device runs in wall time, and lock-step does not; run with --mode realtime, or "
      "with --device emulated",
      name);
}

}  // namespace subworld
