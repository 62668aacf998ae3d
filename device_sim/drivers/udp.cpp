// Driver of a device in another program: poses arrive as UDP datagrams, wrenches leave as such (README: the device
// udp).
#include "device_sim/driver.hpp"
#include "device_sim/drivers/pose_socket.hpp"
#include "device_sim/drivers/settings.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>

#include <cstring>
#include <stdexcept>
#include <string>

namespace {

using namespace subworld;

constexpr int kFirstPort = 47800;

class UdpDriver final : public DeviceDriver {
 public:
  DriverCapabilities open(const DriverRequest& request) override {
    DriverSettings settings(request.settings);
    const std::string address = settings.take("address", std::string("127.0.0.1"));
    const double port = settings.take("port", double(kFirstPort + request.user));
    const DriverCapabilities capabilities{
        .degrees_of_freedom = static_cast<int>(settings.take("dof", 6.0)),
        .workspace_m = settings.take("workspace_m", 1.0),
        .force_limit_n = settings.take("force_n", 40.0),
        .torque_limit_n_m = settings.take("torque_n_m", 2.0),
        .rate_hz = settings.take("rate_hz", 1000.0),
        .measures_velocity = settings.take("velocity", 1.0) != 0.0,
    };
    settings.check();
    measures_velocity_ = capabilities.measures_velocity;
    sockaddr_in own{};
    own.sin_family = AF_INET;
    if (!(port >= 1.0 && port <= 65535.0)) throw std::invalid_argument("setting port: must be from 1 to 65535");
    own.sin_port = htons(static_cast<std::uint16_t>(port));
    if (inet_pton(AF_INET, address.c_str(), &own.sin_addr) != 1)
      throw std::invalid_argument("setting address=" + address + ": must be an IPv4 address of this machine");
    socket_.open(reinterpret_cast<const sockaddr*>(&own), sizeof own,
                 "port " + std::to_string(static_cast<int>(port)) + " of " + address);
    return capabilities;
  }

  bool read(DriverReading& reading) override {
    return socket_.read([&](const PoseDatagram& came) { fill(reading, came); });
  }

  void write(const DriverWrench& wrench) override { socket_.answer(wrench); }

  void close() override { socket_.close(); }

 private:
  void fill(DriverReading& reading, const PoseDatagram& came) const {
    reading = {.time_s = came.time_s, .buttons = came.buttons};
    std::memcpy(reading.position_m.data(), came.position_m, sizeof came.position_m);
    std::memcpy(reading.orientation.data(), came.orientation, sizeof came.orientation);
    if (!measures_velocity_ || (came.flags & kHasVelocity) == 0) return;
    std::memcpy(reading.linear_velocity_m_s.data(), came.linear_velocity_m_s, sizeof came.linear_velocity_m_s);
    std::memcpy(reading.angular_velocity_rad_s.data(), came.angular_velocity_rad_s, sizeof came.angular_velocity_rad_s);
  }

  PoseSocket socket_;
  bool measures_velocity_ = true;
};

constexpr DriverPlugin kPlugin{
    .name = "udp",
    .version = "1",
    .settings = "address=127.0.0.1 port=47800+user dof=6 workspace_m=1 force_n=40 torque_n_m=2 rate_hz=1000 velocity=1",
    .make = [] { return std::unique_ptr<DeviceDriver>(std::make_unique<UdpDriver>()); }};

}  // namespace

SUBWORLD_DRIVER_PLUGIN(kPlugin)
