// Driver of a device in another program: poses arrive as UDP datagrams, wrenches leave as such (README: the device
// udp).
#include "device_sim/driver.hpp"
#include "device_sim/drivers/settings.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <bit>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>

namespace {

using namespace subworld;
using Clock = std::chrono::steady_clock;

static_assert(std::endian::native == std::endian::little);

constexpr int kFirstPort = 47800;
constexpr std::uint32_t kPoseMark = 0x31505753;    // "SWP1"
constexpr std::uint32_t kWrenchMark = 0x31575753;  // "SWW1"
constexpr std::uint32_t kHasVelocity = 1;
constexpr int kMostAtOnce = 64;                              // datagrams in a read: a flood stops nothing
constexpr auto kForgotten = std::chrono::milliseconds(100);  // after that, another sender may take over

struct PoseDatagram {
  std::uint32_t mark, number;
  double time_s;
  double position_m[3];
  double orientation[4];
  double linear_velocity_m_s[3];
  double angular_velocity_rad_s[3];
  std::uint32_t buttons, flags;
};
static_assert(sizeof(PoseDatagram) == 128);

struct WrenchDatagram {
  std::uint32_t mark, number;
  double time_s;
  double force_n[3];
  double torque_n_m[3];
};
static_assert(sizeof(WrenchDatagram) == 64);

[[noreturn]] void fail(const std::string& what) { throw std::runtime_error(what + ": " + std::strerror(errno)); }

class UdpDriver final : public DeviceDriver {
 public:
  ~UdpDriver() override { close_socket(); }

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
    if (!(port >= 1.0 && port <= 65535.0)) throw std::runtime_error("setting port: must be from 1 to 65535");
    own.sin_port = htons(static_cast<std::uint16_t>(port));
    if (inet_pton(AF_INET, address.c_str(), &own.sin_addr) != 1)
      throw std::runtime_error("setting address=" + address + ": must be an IPv4 address of this machine");
    socket_ = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (socket_ < 0) fail("socket");
    if (bind(socket_, reinterpret_cast<const sockaddr*>(&own), sizeof own) != 0)
      fail("port " + std::to_string(static_cast<int>(port)) + " of " + address);
    return capabilities;
  }

  bool read(DriverReading& reading) override {
    bool fresh = false;
    for (int i = 0; i < kMostAtOnce; ++i) {
      PoseDatagram came{};
      sockaddr_in from{};
      socklen_t size = sizeof from;
      const ssize_t bytes = recvfrom(socket_, &came, sizeof came, MSG_TRUNC, reinterpret_cast<sockaddr*>(&from), &size);
      if (bytes < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) break;
      if (bytes < 0) {
        if (errno == ECONNREFUSED || errno == EINTR) continue;
        fail("receive");
      }
      if (bytes != sizeof came || came.mark != kPoseMark || !accepts(from, came)) continue;
      fill(reading, came);
      fresh = true;
    }
    return fresh;
  }

  void write(const DriverWrench& wrench) override {
    if (!sender_) return;
    WrenchDatagram out{.mark = kWrenchMark, .number = number_, .time_s = time_s_, .force_n = {}, .torque_n_m = {}};
    std::memcpy(out.force_n, wrench.force_n.data(), sizeof out.force_n);
    std::memcpy(out.torque_n_m, wrench.torque_n_m.data(), sizeof out.torque_n_m);
    // A peer that does not listen is noticed by the absence of its poses.
    (void)sendto(socket_, &out, sizeof out, MSG_NOSIGNAL, reinterpret_cast<const sockaddr*>(&*sender_),
                 sizeof *sender_);
  }

  void close() override { close_socket(); }

 private:
  /// One sender at a time, and only datagrams that are newer than the last one.
  bool accepts(const sockaddr_in& from, const PoseDatagram& came) {
    const auto now = Clock::now();
    const bool known = sender_ && now - heard_ < kForgotten;
    if (known) {
      const bool same = from.sin_addr.s_addr == sender_->sin_addr.s_addr && from.sin_port == sender_->sin_port;
      if (!same || static_cast<std::int32_t>(came.number - number_) <= 0) return false;
    }
    sender_ = from;
    heard_ = now;
    number_ = came.number;
    time_s_ = came.time_s;
    return true;
  }

  void fill(DriverReading& reading, const PoseDatagram& came) const {
    reading = {.time_s = came.time_s, .buttons = came.buttons};
    std::memcpy(reading.position_m.data(), came.position_m, sizeof came.position_m);
    std::memcpy(reading.orientation.data(), came.orientation, sizeof came.orientation);
    if (!measures_velocity_ || (came.flags & kHasVelocity) == 0) return;
    std::memcpy(reading.linear_velocity_m_s.data(), came.linear_velocity_m_s, sizeof came.linear_velocity_m_s);
    std::memcpy(reading.angular_velocity_rad_s.data(), came.angular_velocity_rad_s, sizeof came.angular_velocity_rad_s);
  }

  void close_socket() {
    if (socket_ >= 0) ::close(socket_);
    socket_ = -1;
  }

  int socket_ = -1;
  bool measures_velocity_ = true;
  std::optional<sockaddr_in> sender_;
  Clock::time_point heard_;
  std::uint32_t number_ = 0;
  double time_s_ = 0.0;
};

constexpr DriverPlugin kPlugin{
    .name = "udp",
    .version = "1",
    .settings = "address=127.0.0.1 port=47800+user dof=6 workspace_m=1 force_n=40 torque_n_m=2 rate_hz=1000 velocity=1",
    .make = [] { return std::unique_ptr<DeviceDriver>(std::make_unique<UdpDriver>()); }};

}  // namespace

SUBWORLD_DRIVER_PLUGIN(kPlugin)
