#pragma once

#include "device_sim/driver.hpp"
#include "model/tool_link.hpp"

#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <stdexcept>
#include <string>

namespace subworld {

/// Receives the poses of one sender at a time, and answers with wrenches. Another sender may take over when the first
/// one has sent nothing for 0.1 s. An address on this machine takes those of the own user and of root only.
class PoseSocket {
 public:
  PoseSocket() = default;
  ~PoseSocket() { close(); }
  PoseSocket(const PoseSocket&) = delete;
  PoseSocket& operator=(const PoseSocket&) = delete;

  /// `name` is the address in words. Throws `std::runtime_error`.
  void open(const sockaddr* own, socklen_t size, const std::string& name) {
    socket_ = socket(own->sa_family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (socket_ < 0) fail("socket");
    const int on = 1;
    is_local_ = own->sa_family == AF_UNIX;
    if (is_local_ && setsockopt(socket_, SOL_SOCKET, SO_PASSCRED, &on, sizeof on) != 0) fail("socket");
    if (bind(socket_, own, size) != 0) fail(name);
  }
  void close() {
    if (socket_ >= 0) ::close(socket_);
    socket_ = -1;
  }

  /// Calls `take` with each pose that has arrived and counts. False: there was none. Throws `std::runtime_error`.
  template <class Take>
  bool read(Take take) {
    bool fresh = false;
    for (int i = 0; i < kMostAtOnce; ++i) {
      PoseDatagram came{};
      Sender from;
      iovec part{&came, sizeof came};
      alignas(cmsghdr) char control[CMSG_SPACE(sizeof(ucred))] = {};
      msghdr message{};
      message.msg_name = from.get();
      message.msg_namelen = from.size;
      message.msg_iov = &part;
      message.msg_iovlen = 1;
      message.msg_control = control;
      message.msg_controllen = sizeof control;
      const ssize_t bytes = recvmsg(socket_, &message, MSG_TRUNC | MSG_CMSG_CLOEXEC);
      from.size = message.msg_namelen;
      if (bytes < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) break;
      if (bytes < 0) {
        if (errno == ECONNREFUSED || errno == EINTR) continue;
        fail("receive");
      }
      if (bytes != sizeof came || came.mark != kPoseMark || (is_local_ && !is_of_own_user(message))) continue;
      if (!accepts(from, came)) continue;
      take(came);
      fresh = true;
    }
    return fresh;
  }

  /// To the sender of the newest pose.
  void answer(const DriverWrench& wrench) {
    if (sender_.size == 0) return;
    WrenchDatagram out{.mark = kWrenchMark, .number = number_, .time_s = time_s_, .force_n = {}, .torque_n_m = {}};
    std::memcpy(out.force_n, wrench.force_n.data(), sizeof out.force_n);
    std::memcpy(out.torque_n_m, wrench.torque_n_m.data(), sizeof out.torque_n_m);
    // A peer that does not listen is noticed by the absence of its poses.
    (void)sendto(socket_, &out, sizeof out, MSG_NOSIGNAL, sender_.get(), sender_.size);
  }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr int kMostAtOnce = 64;                              // datagrams in a read: a flood stops nothing
  static constexpr auto kForgotten = std::chrono::milliseconds(100);  // after that, another sender may take over

  struct Sender {
    sockaddr_storage storage{};
    socklen_t size = sizeof(sockaddr_storage);
    [[nodiscard]] sockaddr* get() noexcept { return reinterpret_cast<sockaddr*>(&storage); }
  };

  [[noreturn]] static void fail(const std::string& what) {
    throw std::runtime_error(what + ": " + std::strerror(errno));
  }

  static bool is_of_own_user(const msghdr& message) {
    const cmsghdr* const head = CMSG_FIRSTHDR(&message);
    if (head == nullptr || head->cmsg_type != SCM_CREDENTIALS) return false;
    ucred sender{};
    std::memcpy(&sender, CMSG_DATA(head), sizeof sender);
    return sender.uid == geteuid() || sender.uid == 0;
  }

  /// One sender at a time, and only datagrams that are newer than the last one.
  bool accepts(const Sender& from, const PoseDatagram& came) {
    const auto now = Clock::now();
    const bool known = heard_ != Clock::time_point{} && now - heard_ < kForgotten;
    if (known) {
      const bool same = from.size == sender_.size && std::memcmp(&from.storage, &sender_.storage, from.size) == 0;
      if (!same || static_cast<std::int32_t>(came.number - number_) <= 0) return false;
    }
    sender_ = from;
    heard_ = now;
    number_ = came.number;
    time_s_ = came.time_s;
    return true;
  }

  int socket_ = -1;
  bool is_local_ = false;
  Sender sender_{.storage = {}, .size = 0};
  Clock::time_point heard_;
  std::uint32_t number_ = 0;
  double time_s_ = 0.0;
};

}  // namespace subworld
