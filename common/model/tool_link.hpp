#pragma once

#include <sys/socket.h>
#include <sys/un.h>

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

/// Datagrams between `device_sim` and the program that has its device (device_sim/README.md: the devices udp and
/// browser). All numbers are little-endian.
namespace subworld {

static_assert(std::endian::native == std::endian::little);

inline constexpr std::uint32_t kPoseMark = 0x31505753;    // "SWP1"
inline constexpr std::uint32_t kWrenchMark = 0x31575753;  // "SWW1"
/// Flags of a pose.
inline constexpr std::uint32_t kHasVelocity = 1, kReleased = 2;

struct PoseDatagram {
  std::uint32_t mark, number;
  double time_s;
  double position_m[3];
  double orientation[4];  ///< w, x, y, z
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

/// Largest distance of a tool from where its page took it, along each axis, m.
inline constexpr double kToolReach_m = 2.0;

/// Address of a socket on this machine.
struct LocalAddress {
  sockaddr_un name{};
  socklen_t size = 0;
  [[nodiscard]] const sockaddr* get() const noexcept { return reinterpret_cast<const sockaddr*>(&name); }
};

/// Where the device `browser` of a user receives poses: a name of the run on this machine, without a file, that no
/// other host can reach.
[[nodiscard]] inline LocalAddress tool_address(int domain, int user) {
  const std::string text = "subworld-browser-" + std::to_string(domain) + "-" + std::to_string(user);
  LocalAddress address;
  address.name.sun_family = AF_UNIX;
  std::memcpy(address.name.sun_path + 1, text.data(), text.size());  // a name that begins with 0 has no file
  address.size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + text.size());
  return address;
}

}  // namespace subworld
