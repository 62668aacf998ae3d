#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <functional>
#include <thread>
#include <vector>

namespace subworld::test {

/// The other end of the driver `udp`: written from its description in device_sim/README.md, not from its source.
class UdpPeer {
 public:
  explicit UdpPeer(int port) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<std::uint16_t>(port));
    inet_pton(AF_INET, "127.0.0.1", &to.sin_addr);
    connect(socket_, reinterpret_cast<const sockaddr*>(&to), sizeof to);
  }
  ~UdpPeer() { close(socket_); }
  UdpPeer(const UdpPeer&) = delete;
  UdpPeer& operator=(const UdpPeer&) = delete;

  void send_bytes(const void* bytes, std::size_t size) { (void)!::send(socket_, bytes, size, MSG_DONTWAIT); }

  void send_pose(std::uint32_t number, double time_s, const std::array<double, 3>& position_m,
                 std::uint32_t buttons = 0) {
    std::array<char, 128> out{};
    std::memcpy(out.data(), "SWP1", 4);
    std::memcpy(&out[4], &number, 4);
    std::memcpy(&out[8], &time_s, 8);
    std::memcpy(&out[16], position_m.data(), 24);
    const double unit = 1.0;
    std::memcpy(&out[40], &unit, 8);
    std::memcpy(&out[120], &buttons, 4);
    send_bytes(out.data(), out.size());
  }
  /// The newest wrench that has arrived: force x, y, z. False: none.
  bool receive(std::array<double, 3>& force_n) {
    std::array<char, 65> in{};
    bool came = false;
    while (recv(socket_, in.data(), in.size(), MSG_DONTWAIT) == 64) {
      if (std::memcmp(in.data(), "SWW1", 4) != 0) continue;
      std::memcpy(force_n.data(), &in[16], 24);
      came = true;
    }
    return came;
  }

 private:
  int socket_ = socket(AF_INET, SOCK_DGRAM, 0);
};

/// Sends the position that `place` returns each millisecond, from a thread of its own; none while it is unplugged.
class UdpDevice {
 public:
  explicit UdpDevice(int port) : peer_(port), thread_([this] { run(); }) {}
  ~UdpDevice() {
    stop_ = true;
    thread_.join();
  }
  UdpDevice(const UdpDevice&) = delete;
  UdpDevice& operator=(const UdpDevice&) = delete;

  void unplug(bool unplugged) { unplugged_ = unplugged; }
  void press(bool pressed) { buttons_ = pressed ? 1 : 0; }
  void place(double x_m, double y_m = 0.0) {
    x_m_ = x_m;
    y_m_ = y_m;
  }
  /// Moves along x in equal steps, in this time.
  void move_to(double x_m, double during_s) {
    const double from_m = x_m_;
    const int steps = static_cast<int>(during_s * 1e3);
    for (int i = 1; i <= steps; ++i) {
      x_m_ = from_m + (x_m - from_m) * i / steps;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }
  [[nodiscard]] double force_x_n() const { return force_x_n_; }

 private:
  void run() {
    const auto begin = std::chrono::steady_clock::now();
    std::array<double, 3> force_n{};
    for (std::uint32_t number = 1; !stop_; ++number) {
      const double t = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      if (!unplugged_) peer_.send_pose(number, t, {x_m_, y_m_, 0.0}, buttons_);
      if (peer_.receive(force_n)) force_x_n_ = force_n[0];
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  UdpPeer peer_;
  std::atomic<std::uint32_t> buttons_ = 0;
  std::atomic<bool> stop_ = false, unplugged_ = false;
  std::atomic<double> x_m_ = 0.0, y_m_ = 0.0, force_x_n_ = 0.0;
  std::thread thread_;
};

}  // namespace subworld::test
