#pragma once

#include "model/tool_link.hpp"

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace subworld::live {

/// The tools of those users whose device is `browser`: who holds which, and the poses on their way to `device_sim`. One
/// connection at a time holds a tool. It takes the tool by its first pose, and releases it by a message, by closing, or
/// by sending none for `kQuiet`. No function waits. One thread.
class Tools {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::milliseconds kQuiet{1000};

  /// `domain`: of the run.
  Tools(int domain, int users);
  ~Tools();
  Tools(const Tools&) = delete;
  Tools& operator=(const Tools&) = delete;

  /// A `ToolPose` in CDR, from the connection of this number, which is not 0. Returns why it is refused; empty: it is
  /// not.
  [[nodiscard]] std::string move(int user, std::uint32_t connection, std::span<const std::uint8_t> cdr,
                                 Clock::time_point now);
  /// This connection holds the tool no more.
  void release(int user, std::uint32_t connection) noexcept;
  /// Nor any other.
  void release(std::uint32_t connection) noexcept;
  /// Once in a while: looks for devices, and ends what `kQuiet` ends.
  void inspect(Clock::time_point now) noexcept;
  /// The state of all tools in CDR, `schema()`.
  [[nodiscard]] std::vector<std::uint8_t> state() const;
  /// The user of "/user_N/tool"; none: it is another topic.
  [[nodiscard]] std::optional<int> user_of(std::string_view topic) const;

  [[nodiscard]] static std::string schema();

 private:
  struct Tool {
    LocalAddress address;
    int socket = -1;
    bool offered = false;        // its device is there
    bool known = false;          // it has been
    std::uint32_t informed = 0;  // the connection that knows that it has ended
    std::uint32_t holder = 0;    // 0: none
    std::uint32_t number = 0;    // of the newest datagram
    Clock::time_point heard;
  };
  void look_for(Tool& tool) noexcept;
  /// Why a pose has no device. That a device has ended is said once, to a page that goes on sending: runs end so.
  [[nodiscard]] std::string absence(int user, std::uint32_t connection);
  void send(Tool& tool, PoseDatagram pose) noexcept;

  std::vector<Tool> tools_;  // of each user
};

}  // namespace subworld::live
