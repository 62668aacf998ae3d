#include "link/host.hpp"

#include "model/error.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/core.h>
#include <linux/if_tun.h>
#include <net/if.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <exception>
#include <thread>
#include <utility>

namespace subworld {

namespace {

constexpr int kTunQueue = 4000;  // packets that wait for the forwarder, at most

[[noreturn]] void fail(const std::string& what, const std::string& cure) {
  const int error = errno;
  throw Error(ExitCode::failed,
              fmt::format("link: {}: {}{}{}", what, std::strerror(error), cure.empty() ? "" : "; ", cure));
}

/// A descriptor that is closed at the end of its scope, unless it is released.
class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  [[nodiscard]] int get() const { return number_; }
  int release() { return std::exchange(number_, -1); }

 private:
  int number_;
};

ifreq request_for(const std::string& device) {
  ifreq request{};
  std::strncpy(request.ifr_name, device.c_str(), IFNAMSIZ - 1);
  return request;
}

void bring_up(int socket, const std::string& device) {
  ifreq request = request_for(device);
  if (ioctl(socket, SIOCGIFFLAGS, &request) < 0) fail("flags of " + device, "");
  request.ifr_flags = static_cast<short>(request.ifr_flags | IFF_UP | IFF_RUNNING | IFF_MULTICAST);
  if (ioctl(socket, SIOCSIFFLAGS, &request) < 0) fail("start of " + device, "");
}

/// Sets one thing of a device; `fill` puts it into the request.
template <class Fill>
void configure(int socket, const std::string& device, unsigned long code, const std::string& what, Fill fill) {
  ifreq request = request_for(device);
  fill(request);
  if (ioctl(socket, code, &request) < 0) fail(what + " of " + device, "");
}

/// The programs use IPv4; without this the kernel would announce itself over the link.
void disable_ipv6() {
  const Descriptor file(open("/proc/sys/net/ipv6/conf/default/disable_ipv6", O_WRONLY | O_CLOEXEC));
  if (file.get() >= 0) [[maybe_unused]]
    const auto written = write(file.get(), "1", 1);
}

int make_namespace() {
  if (unshare(CLONE_NEWNET) != 0)
    fail("cannot make a network namespace", "run as root, or in a user namespace: unshare -rn subworld link ...");
  const Descriptor space(open("/proc/thread-self/ns/net", O_RDONLY | O_CLOEXEC));
  if (space.get() < 0) fail("/proc/thread-self/ns/net", "mount /proc");
  disable_ipv6();
  const Descriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  bring_up(socket.get(), "lo");
  return fcntl(space.get(), F_DUPFD_CLOEXEC, 0);
}

/// Calls `act` in a new thread and passes on what it throws.
void in_thread(const std::function<void()>& act) {
  std::exception_ptr thrown;
  std::thread([&] {
    try {
      act();
    } catch (...) {
      thrown = std::current_exception();
    }
  }).join();
  if (thrown) std::rethrow_exception(thrown);
}

}  // namespace

NetworkHost::NetworkHost(std::string name) : name_(std::move(name)) {
  in_thread([this] { namespace_ = make_namespace(); });
}

NetworkHost::~NetworkHost() {
  if (namespace_ >= 0) close(namespace_);
}

NetworkHost::NetworkHost(NetworkHost&& other) noexcept
    : name_(std::move(other.name_)), namespace_(std::exchange(other.namespace_, -1)) {}

std::string NetworkHost::path() const { return fmt::format("/proc/{}/fd/{}", getpid(), namespace_); }

bool NetworkHost::enter() const noexcept { return setns(namespace_, CLONE_NEWNET) == 0; }

void NetworkHost::inside(const std::function<void()>& act) const {
  in_thread([&] {
    if (!enter()) fail("cannot enter host " + name_, "run as root");
    act();
  });
}

pid_t NetworkHost::start(const std::string& command) const {
  const pid_t parent = getpid();
  const pid_t child = fork();
  if (child < 0) fail("cannot start \"" + command + "\"", "");
  if (child > 0) return child;
  setpgid(0, 0);
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGPIPE, SIGALRM}) std::signal(number, SIG_DFL);
  const int nothing = open("/dev/null", O_RDONLY);
  if (getppid() != parent || nothing < 0 || dup2(nothing, STDIN_FILENO) < 0 || !enter()) _exit(126);
  execl("/bin/sh", "sh", "-c", command.c_str(), static_cast<char*>(nullptr));
  _exit(127);
}

int open_tun(const std::string& device, const std::string& address, int mtu) {
  constexpr const char* kCure = "the kernel needs the module tun, and a container the device /dev/net/tun";
  Descriptor tun(open("/dev/net/tun", O_RDWR | O_NONBLOCK | O_CLOEXEC));
  if (tun.get() < 0) fail("/dev/net/tun", errno == EACCES ? "run as root, or allow this user to open it" : kCure);
  ifreq request = request_for(device);
  request.ifr_flags = IFF_TUN | IFF_NO_PI;
  if (ioctl(tun.get(), TUNSETIFF, &request) < 0) fail("cannot make the device " + device, "run as root");
  const Descriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  configure(socket.get(), device, SIOCSIFMTU, "MTU", [&](ifreq& one) { one.ifr_mtu = mtu; });
  request = request_for(device);
  request.ifr_qlen = kTunQueue;
  ioctl(socket.get(), SIOCSIFTXQLEN, &request);  // not in a user namespace: 500 packets
  const auto set_address = [&](unsigned long code, const std::string& what, const std::string& text) {
    sockaddr_in in{};
    in.sin_family = AF_INET;
    inet_pton(AF_INET, text.c_str(), &in.sin_addr);
    configure(socket.get(), device, code, what, [&](ifreq& one) { std::memcpy(&one.ifr_addr, &in, sizeof in); });
  };
  set_address(SIOCSIFADDR, "address", address);
  set_address(SIOCSIFNETMASK, "net mask", "255.255.255.0");
  bring_up(socket.get(), device);
  return tun.release();
}

}  // namespace subworld
