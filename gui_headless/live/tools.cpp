#include "tools.hpp"

#include "written.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <utility>

namespace subworld::live {
namespace {

constexpr std::size_t kCdrHead = 4, kPoseBytes = 61, kPadding = 3;
constexpr double kUnit = 1e-3;  // largest deviation of a quaternion's length from 1

/// What a page sends; its schema is in README.md.
struct ToolPose {
  std::array<double, 3> position_m{};
  std::array<double, 4> orientation{};  // w, x, y, z
  std::uint32_t buttons = 0;
  bool held = false;
};

std::optional<ToolPose> decode(std::span<const std::uint8_t> cdr) {
  constexpr std::array<std::uint8_t, 2> kLittleEndian{0, 1};
  if (cdr.size() < kCdrHead + kPoseBytes || cdr.size() > kCdrHead + kPoseBytes + kPadding ||
      !std::equal(kLittleEndian.begin(), kLittleEndian.end(), cdr.begin()))
    return std::nullopt;
  const std::uint8_t* at = cdr.data() + kCdrHead;
  const auto read = [&](auto& value) {
    std::memcpy(&value, at, sizeof value);
    at += sizeof value;
  };
  ToolPose pose;
  read(pose.position_m);
  read(pose.orientation);
  read(pose.buttons);
  pose.held = *at != 0;
  return pose;
}

std::string fault_of(const ToolPose& pose) {
  const auto finite = [](double value) { return std::isfinite(value); };
  if (!std::ranges::all_of(pose.position_m, finite) || !std::ranges::all_of(pose.orientation, finite))
    return "is not finite";
  const auto& q = pose.orientation;
  if (std::abs(std::hypot(std::hypot(q[0], q[1]), std::hypot(q[2], q[3])) - 1.0) > kUnit)
    return "has an orientation that is no unit quaternion";
  if (std::ranges::any_of(pose.position_m, [](double value) { return std::abs(value) > kToolReach_m; }))
    return fmt::format("is more than {} m from where the tool was taken; are positions in metres?", kToolReach_m);
  return {};
}

}  // namespace

Tools::Tools(int domain, int users) : tools_(static_cast<std::size_t>(std::max(users, 0))) {
  for (std::size_t user = 0; user < tools_.size(); ++user)
    tools_[user].address = tool_address(domain, static_cast<int>(user));
}

Tools::~Tools() {
  for (const Tool& tool : tools_)
    if (tool.socket >= 0) close(tool.socket);
}

std::string Tools::move(int user, std::uint32_t connection, std::span<const std::uint8_t> cdr, Clock::time_point now) {
  const auto at = static_cast<std::size_t>(user);
  if (user < 0 || at >= tools_.size()) return fmt::format("there is no user {}", user);
  const std::optional<ToolPose> pose = decode(cdr);
  if (!pose) return "the message is no subworld::msg::ToolPose";
  Tool& tool = tools_[at];
  if (!pose->held) {
    release(user, connection);
    return {};
  }
  if (const std::string fault = fault_of(*pose); !fault.empty()) return fmt::format("the pose {}", fault);
  if (!tool.offered) look_for(tool);
  if (!tool.offered) return absence(user, connection);
  if (tool.holder != 0 && tool.holder != connection) return fmt::format("another page holds the tool of user {}", user);
  tool.holder = connection;
  tool.heard = now;
  PoseDatagram out{};
  out.buttons = pose->buttons;
  std::ranges::copy(pose->position_m, out.position_m);
  std::ranges::copy(pose->orientation, out.orientation);
  send(tool, out);
  return tool.offered ? "" : absence(user, connection);
}

std::string Tools::absence(int user, std::uint32_t connection) {
  Tool& tool = tools_[static_cast<std::size_t>(user)];
  if (!tool.known)
    return fmt::format("user {} has no device that a page can be; start the run with --device browser", user);
  if (std::exchange(tool.informed, connection) == connection) return {};
  return fmt::format("the device of user {} has ended", user);
}

void Tools::release(int user, std::uint32_t connection) noexcept {
  Tool& tool = tools_[static_cast<std::size_t>(user)];
  if (tool.holder != connection) return;
  tool.holder = 0;
  PoseDatagram pose{};
  pose.flags = kReleased;
  send(tool, pose);
}

void Tools::release(std::uint32_t connection) noexcept {
  for (std::size_t user = 0; user < tools_.size(); ++user) release(static_cast<int>(user), connection);
}

void Tools::inspect(Clock::time_point now) noexcept {
  for (std::size_t user = 0; user < tools_.size(); ++user) {
    Tool& tool = tools_[user];
    if (tool.holder != 0 && now - tool.heard > kQuiet) release(static_cast<int>(user), tool.holder);
    look_for(tool);
  }
}

/// Connects again even where it is connected: that is how the end of a device shows without a pose.
void Tools::look_for(Tool& tool) noexcept {
  if (tool.socket < 0) {
    tool.socket = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    // With a name of its own, which the kernel chooses, the device distinguishes this sender from others.
    constexpr sockaddr_un kAnyName{.sun_family = AF_UNIX, .sun_path = {}};
    (void)bind(tool.socket, reinterpret_cast<const sockaddr*>(&kAnyName), sizeof kAnyName.sun_family);
  }
  tool.offered = connect(tool.socket, tool.address.get(), tool.address.size) == 0;
  if (tool.offered) {
    tool.known = true;
    tool.informed = 0;
  } else {
    tool.holder = 0;
  }
}

/// A pose that finds no room in the socket of a halted device is dropped: the next one is newer.
void Tools::send(Tool& tool, PoseDatagram pose) noexcept {
  pose.mark = kPoseMark;
  pose.number = ++tool.number;
  pose.time_s = std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
  if (::send(tool.socket, &pose, sizeof pose, MSG_DONTWAIT | MSG_NOSIGNAL) >= 0 || errno == EAGAIN) return;
  tool.offered = false;
  tool.holder = 0;
}

std::string Tools::schema() {
  return "module subworld {\nmodule msg {\n@final struct Tool {\n  unsigned long user;\n  unsigned long holder;\n};\n"
         "@final struct Tools {\n  sequence<Tool> tools;\n};\n};\n};\n";
}

std::vector<std::uint8_t> Tools::state() const {
  std::vector<std::array<std::uint32_t, 2>> offered;
  for (std::size_t user = 0; user < tools_.size(); ++user)
    if (tools_[user].offered) offered.push_back({static_cast<std::uint32_t>(user), tools_[user].holder});
  return written([&](CdrWriter& cdr) {
    cdr.sequence("", offered, [&](std::size_t, const auto& one) {
      for (const std::uint32_t number : one) cdr("", number);
    });
  });
}

std::optional<int> Tools::user_of(std::string_view topic) const {
  for (int user = 0; user < static_cast<int>(tools_.size()); ++user)
    if (topic == fmt::format("/user_{}/tool", user)) return user;
  return std::nullopt;
}

}  // namespace subworld::live
