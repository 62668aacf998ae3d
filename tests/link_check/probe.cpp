#include "link_check/probe.hpp"

#include "model/error.hpp"
#include "rt/cyclic.hpp"
#include "rt/stop.hpp"

#include <arpa/inet.h>
#include <fmt/core.h>
#include <pthread.h>
#include <sched.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <ctime>
#include <memory>
#include <thread>

namespace subworld {

namespace {

constexpr std::uint16_t kProbePort = 7399;  // below the ports of DDS
constexpr int kHeaders = 28;                // bytes of IPv4 and UDP
constexpr int kProbePriority = 85;          // below the forwarder

/// Contents of a probe packet.
struct Stamp {
  std::uint32_t number = 0;
  std::int64_t sent_ns = 0;  ///< CLOCK_REALTIME, which the kernel stamps arrivals with
};

std::int64_t realtime_ns() noexcept {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

sockaddr_in probe_address(const std::string& address) {
  sockaddr_in in{};
  in.sin_family = AF_INET;
  in.sin_port = htons(kProbePort);
  inet_pton(AF_INET, address.c_str(), &in.sin_addr);
  return in;
}

void claim_probe_priority(std::thread& thread) {
  sched_param parameter{};
  parameter.sched_priority = kProbePriority;
  pthread_setschedparam(thread.native_handle(), SCHED_FIFO, &parameter);  // without the right: later wake-ups
}

/// A socket of a host for probes; those from all other hosts arrive at it.
class ProbeSocket {
 public:
  ProbeSocket(const EmulatedNetwork& network, int host) {
    network.host(host).inside([&] {
      number_ = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
      const int on = 1, bytes = 8 << 20;
      const timeval wait{0, 50'000};
      setsockopt(number_, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
      if (setsockopt(number_, SOL_SOCKET, SO_RCVBUFFORCE, &bytes, sizeof bytes) != 0)
        setsockopt(number_, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
      setsockopt(number_, SOL_SOCKET, SO_RCVTIMEO, &wait, sizeof wait);
      const sockaddr_in address = probe_address(network.address(host));
      if (number_ < 0 || bind(number_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
        throw Error(ExitCode::failed,
                    fmt::format("link: probe on host {}: {}", network.host(host).name(), std::strerror(errno)));
    });
  }
  ~ProbeSocket() {
    if (number_ >= 0) close(number_);
  }
  ProbeSocket(const ProbeSocket&) = delete;
  ProbeSocket& operator=(const ProbeSocket&) = delete;
  [[nodiscard]] int get() const { return number_; }

 private:
  int number_ = -1;
};

/// When the kernel received a message, ns; now, where it has no stamp.
std::int64_t arrival_ns(msghdr& message) noexcept {
  for (cmsghdr* part = CMSG_FIRSTHDR(&message); part != nullptr; part = CMSG_NXTHDR(&message, part)) {
    if (part->cmsg_level != SOL_SOCKET || part->cmsg_type != SCM_TIMESTAMPNS) continue;
    timespec stamp{};
    std::memcpy(&stamp, CMSG_DATA(part), sizeof stamp);
    return std::int64_t{stamp.tv_sec} * 1'000'000'000 + stamp.tv_nsec;
  }
  return realtime_ns();
}

void receive_probes(int socket, std::int64_t start_ns, const std::atomic<bool>& stop, Probed& result) {
  Stamp stamp;
  iovec place{&stamp, sizeof stamp};
  alignas(cmsghdr) char control[64];
  while (!stop) {
    msghdr message{};
    message.msg_iov = &place;
    message.msg_iovlen = 1;
    message.msg_control = control;
    message.msg_controllen = sizeof control;
    if (recvmsg(socket, &message, 0) < static_cast<ssize_t>(sizeof stamp)) continue;
    const std::int64_t now = arrival_ns(message);
    result.last_s = 1e-9 * static_cast<double>(now - start_ns);
    if (result.arrivals.empty()) result.first_s = result.last_s;
    if (result.arrivals.size() < result.arrivals.capacity())
      result.arrivals.push_back({stamp.number, 1e-9 * static_cast<double>(now - stamp.sent_ns)});
  }
}

void send_probes(int socket, const sockaddr_in& to, const ProbePlan& plan, std::uint64_t count, std::uint64_t& sent) {
  std::vector<char> packet(std::max<std::size_t>(sizeof(Stamp), plan.bytes - kHeaders));
  Cyclic cycle(Clock::now(), from_seconds(1.0 / plan.rate_hz));
  for (std::uint64_t i = 0; i < count && stop_signal() == 0; ++i) {
    cycle.wait();
    const Stamp stamp{static_cast<std::uint32_t>(i), realtime_ns()};
    std::memcpy(packet.data(), &stamp, sizeof stamp);
    sendto(socket, packet.data(), packet.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
    sent = i + 1;
  }
}

}  // namespace

std::vector<Probed> probe(const EmulatedNetwork& network, const std::vector<ProbePlan>& plans, double rest_s) {
  std::vector<Probed> results(plans.size());
  std::vector<std::unique_ptr<ProbeSocket>> from, to;
  std::vector<std::thread> senders, receivers;
  std::atomic<bool> stop{false};
  const std::int64_t start_ns = realtime_ns();
  for (const ProbePlan& plan : plans) to.push_back(std::make_unique<ProbeSocket>(network, plan.ends.to));
  for (std::size_t i = 0; i < plans.size(); ++i) {
    const auto count = static_cast<std::uint64_t>(std::llround(plans[i].rate_hz * plans[i].duration_s));
    results[i].arrivals.reserve(2 * count);
    receivers.emplace_back([&, i, socket = to[i]->get()] { receive_probes(socket, start_ns, stop, results[i]); });
    claim_probe_priority(receivers.back());
  }
  for (std::size_t i = 0; i < plans.size(); ++i) {
    // Sent from the socket that the other direction receives with, where there is one: a host has one probe port.
    const auto same =
        std::ranges::find_if(plans, [&](const ProbePlan& other) { return other.ends.to == plans[i].ends.from; });
    if (same == plans.end()) from.push_back(std::make_unique<ProbeSocket>(network, plans[i].ends.from));
    const int socket = same == plans.end() ? from.back()->get() : to[same - plans.begin()]->get();
    senders.emplace_back([&, i, socket] {
      const auto count = static_cast<std::uint64_t>(std::llround(plans[i].rate_hz * plans[i].duration_s));
      send_probes(socket, probe_address(network.address(plans[i].ends.to)), plans[i], count, results[i].sent);
    });
    claim_probe_priority(senders.back());
  }
  for (std::thread& sender : senders) sender.join();
  for (TimePoint until = Clock::now() + from_seconds(rest_s); Clock::now() < until && stop_signal() == 0;)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  stop = true;
  for (std::thread& receiver : receivers) receiver.join();
  return results;
}

}  // namespace subworld
