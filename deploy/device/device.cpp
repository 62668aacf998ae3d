#include "device/device.hpp"

#include "device_sim/drivers.hpp"
#include "io/options/options.hpp"
#include "model/error.hpp"

#include <fmt/core.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

namespace subworld {

void list_devices() {
  fmt::print("emulated: an emulated device and operator, as the scene describes them\n");
  for (const std::string& name : driver_names()) {
    try {
      const DriverPlugin& plugin = driver_plugin(name);
      fmt::print("{}: version {}; settings: {}\n", name, plugin.version,
                 plugin.settings.empty() ? "none" : plugin.settings);
    } catch (const Error& wrong) {
      fmt::print("{}: {}\n", name, wrong.what());
    }
  }
}

int check_device(const std::string& name, const DriverCheckRequest& request) {
  if (name == kEmulated) throw Error(ExitCode::usage, "emulated: has no driver; name one of `subworld device list`");
  if (name == kBrowserDevice) {
    throw Error(
        ExitCode::usage,
        "browser: has no device to examine: it is the page of a run; try `subworld run press --device browser`");
  }
  const DriverPlugin& plugin = driver_plugin(name);
  fmt::print("subworld: checking {} for {} s; move the device meanwhile. Its force is zero.\n", name,
             request.duration_s);
  std::fflush(stdout);
  // The driver runs in a process of its own, so that one that crashes has a verdict, too.
  if (const pid_t child = fork(); child > 0) {
    int status = 0;
    while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    if (WIFEXITED(status)) return WEXITSTATUS(status);
    fmt::print("subworld: verdict: the driver crashes: {}\n", strsignal(WTERMSIG(status)));
    return static_cast<int>(ExitCode::quality);
  }
  const auto properties = check_driver(plugin, request);
  for (const DriverProperty& one : properties)
    fmt::print("  {}: {}: {}\n", one.name, one.found, one.held ? "ok" : "MISSED");
  const auto missed = std::ranges::count(properties, false, &DriverProperty::held);
  fmt::print("subworld: verdict: {}\n",
             missed == 0 ? "ok" : fmt::format("{} of {} properties missed", missed, properties.size()));
  return static_cast<int>(missed == 0 ? ExitCode::done : ExitCode::quality);
}

}  // namespace subworld
