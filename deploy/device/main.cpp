#include "device/device.hpp"
#include "io/options/options.hpp"
#include "io/results/output.hpp"
#include "model/error.hpp"
#include "tools.hpp"

#include <string>

namespace {

using namespace subworld;

void add_check(CommandLine& line, std::string& name, DriverCheckRequest& request) {
  line.add("name", &name, "driver, as `subworld device list` names it").required();
  line.add("--device-settings", &request.settings, "settings of the driver").otherwise("the driver's");
  line.add("--user", &request.user, "user whom the device serves").range(0, static_cast<int>(kMostUsers) - 1);
  line.add("--duration", &request.duration_s, "time in which the device is read").range(0.3, 3600.0, "s");
  line.footer(
      "Examples:\n"
      "  subworld device check udp\n"
      "Exit codes: 0 all properties hold, 4 one is missed, 2 usage.");
}

int main_of(int argc, char** argv) {
  CommandLine line("subworld device", about_tool("device"));
  const CommandLine& list = line.command("list", "Lists the drivers and their settings");
  CommandLine& check = line.command("check", "Examines a driver; move its device meanwhile");
  std::string driver;
  DriverCheckRequest request;
  add_check(check, driver, request);
  if (const auto code = line.parse(argc, argv)) return *code;
  if (!list.chosen()) return check_device(driver, request);
  list_devices();
  return static_cast<int>(ExitCode::done);
}

}  // namespace

int main(int argc, char** argv) {
  return subworld::finished("subworld device",
                            subworld::guarded("subworld device", [&] { return main_of(argc, argv); }));
}
