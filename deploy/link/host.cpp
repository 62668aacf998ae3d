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

void set_address(ifreq& request, const std::string& address) {
  sockaddr_in in{};
  in.sin_family = AF_INET;
  inet_pton(AF_INET, address.c_str(), &in.sin_addr);
  std::memcpy(&request.ifr_addr, &in, sizeof in);
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

/// In a child: default signals, for a program that is to end as usual.
void reset_signals() noexcept {
  for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGPIPE, SIGALRM}) std::signal(number, SIG_DFL);
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
  reset_signals();
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
  request = request_for(device);
  request.ifr_mtu = mtu;
  if (ioctl(socket.get(), SIOCSIFMTU, &request) < 0) fail(fmt::format("MTU {} of {}", mtu, device), "");
  request = request_for(device);
  request.ifr_qlen = kTunQueue;
  ioctl(socket.get(), SIOCSIFTXQLEN, &request);  // not in a user namespace: 500 packets
  request = request_for(device);
  set_address(request, address);
  if (ioctl(socket.get(), SIOCSIFADDR, &request) < 0) fail("address " + address, "");
  set_address(request, "255.255.255.0");
  if (ioctl(socket.get(), SIOCSIFNETMASK, &request) < 0) fail("net mask of " + device, "");
  bring_up(socket.get(), device);
  return tun.release();
}

Finished run_program(const std::vector<std::string>& words, const NetworkHost* host) {
  int ends[2];
  if (pipe2(ends, O_CLOEXEC) != 0) fail("pipe", "");
  const Descriptor output(ends[0]);
  Descriptor input(ends[1]);
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  const pid_t child = fork();
  if (child < 0) fail("cannot start " + words.front(), "");
  if (child == 0) {
    reset_signals();
    if ((host != nullptr && !host->enter()) || dup2(input.get(), STDOUT_FILENO) < 0 ||
        dup2(input.get(), STDERR_FILENO) < 0)
      _exit(126);
    execvp(arguments.front(), arguments.data());
    _exit(127);
  }
  close(input.release());
  Finished finished;
  char buffer[4096];
  for (ssize_t size = 0; (size = read(output.get(), buffer, sizeof buffer)) != 0;) {
    if (size > 0) finished.text.append(buffer, static_cast<std::size_t>(size));
    if (size < 0 && errno != EINTR) break;
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  finished.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return finished;
}

}  // namespace subworld
