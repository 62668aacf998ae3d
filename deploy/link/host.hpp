#pragma once

#include <sys/types.h>

#include <functional>
#include <string>
#include <vector>

namespace subworld {

/// A network namespace of its own, as a host on an emulated network. It has no name in the file system: the kernel
/// removes it with the last process and descriptor that uses it, also where this process is killed.
class NetworkHost {
 public:
  /// Makes the namespace, with loopback up and without IPv6. Throws `Error` (failed) without the rights, with the cure.
  explicit NetworkHost(std::string name);
  ~NetworkHost();
  NetworkHost(NetworkHost&& other) noexcept;
  NetworkHost(const NetworkHost&) = delete;
  NetworkHost& operator=(const NetworkHost&) = delete;

  [[nodiscard]] const std::string& name() const { return name_; }
  /// A path with which other processes of the same rights can enter it while this process lives.
  [[nodiscard]] std::string path() const;
  /// Moves the calling thread into the namespace; safe between fork() and exec(). False where the kernel refuses.
  [[nodiscard]] bool enter() const noexcept;
  /// Calls `act` in the namespace, in a thread of its own. Passes on what it throws.
  void inside(const std::function<void()>& act) const;
  /// Starts a shell command in the namespace, in a process group of its own, with no input. It receives SIGTERM where
  /// this process dies. Throws `Error` (failed).
  [[nodiscard]] pid_t start(const std::string& command) const;

 private:
  std::string name_;
  int namespace_ = -1;
};

/// Makes a TUN device in the calling thread's namespace, gives it an address ("10.9.0.1") in a subnet of 24 bits, and
/// starts it. The device exists while its descriptor is open. Throws `Error` (failed), with the cure.
[[nodiscard]] int open_tun(const std::string& device, const std::string& address, int mtu);

}  // namespace subworld
