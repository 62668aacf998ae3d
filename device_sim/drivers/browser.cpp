// Driver of the device that is a page of the run: the display passes on the poses of the page (README: the device
// browser). The page takes its force from the topic of the device's commands.
#include "device_sim/driver.hpp"
#include "device_sim/drivers/browser_tool.hpp"
#include "device_sim/drivers/pose_socket.hpp"
#include "device_sim/drivers/settings.hpp"

#include <chrono>
#include <optional>
#include <string>

namespace {

using namespace subworld;
using Clock = std::chrono::steady_clock;

class BrowserDriver final : public DeviceDriver {
 public:
  DriverCapabilities open(const DriverRequest& request) override {
    DriverSettings settings(request.settings);
    const DriverCapabilities capabilities{
        .degrees_of_freedom = static_cast<int>(settings.take("dof", 6.0)),
        .workspace_m = settings.take("workspace_m", 1.0),
        .force_limit_n = settings.take("force_n", 40.0),
        .torque_limit_n_m = settings.take("torque_n_m", 2.0),
        .rate_hz = 1000.0,
        .measures_velocity = true,
    };
    settings.check();
    tool_.emplace(capabilities.workspace_m);
    const LocalAddress own = tool_address(request.domain, request.user);
    socket_.open(own.get(), own.size,
                 "another device_sim serves user " + std::to_string(request.user) + " of domain " +
                     std::to_string(request.domain));
    return capabilities;
  }

  bool read(DriverReading& reading) override {
    const double now_s = std::chrono::duration<double>(Clock::now() - begin_).count();
    (void)socket_.read([&](const PoseDatagram& pose) { tool_->receive(pose, now_s); });
    return tool_->read(now_s, reading);
  }

  void write(const DriverWrench&) override {}
  void close() override { socket_.close(); }

 private:
  const Clock::time_point begin_ = Clock::now();
  PoseSocket socket_;
  std::optional<BrowserTool> tool_;
};

constexpr DriverPlugin kPlugin{
    .name = "browser", .version = "1", .settings = "workspace_m=1 dof=6 force_n=40 torque_n_m=2", .make = [] {
      return std::unique_ptr<DeviceDriver>(std::make_unique<BrowserDriver>());
    }};

}  // namespace

SUBWORLD_DRIVER_PLUGIN(kPlugin)
