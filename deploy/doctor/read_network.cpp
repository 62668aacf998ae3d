#include "doctor/facts.hpp"
#include "keys/keys.hpp"

#include <arpa/inet.h>
#include <fmt/core.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <future>
#include <memory>
#include <sstream>
#include <thread>

namespace subworld::doctor {

namespace {

using namespace std::chrono_literals;

std::string text_of(const sockaddr* from) {
  sockaddr_in address{};
  std::memcpy(&address, from, sizeof address);
  std::array<char, INET_ADDRSTRLEN> text{};
  inet_ntop(AF_INET, &address.sin_addr, text.data(), text.size());
  return text.data();
}

/// A UDP socket that closes itself.
class Udp {
 public:
  Udp() : handle_(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {}
  ~Udp() {
    if (handle_ >= 0) close(handle_);
  }
  Udp(const Udp&) = delete;
  Udp& operator=(const Udp&) = delete;
  [[nodiscard]] int handle() const { return handle_; }
  /// From an own address (empty: the one that the kernel chooses) to a port.
  [[nodiscard]] bool connect_to(const std::string& from, const std::string& to, int port) const {
    const sockaddr_in own = address_of(from, 0), other = address_of(to, port);
    return (from.empty() || bind(handle_, reinterpret_cast<const sockaddr*>(&own), sizeof own) == 0) &&
           connect(handle_, reinterpret_cast<const sockaddr*>(&other), sizeof other) == 0;
  }

 private:
  static sockaddr_in address_of(const std::string& text, int port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    inet_pton(AF_INET, text.c_str(), &address.sin_addr);
    return address;
  }
  int handle_;
};

/// Of this network namespace: /sys may show another one.
int mtu_of(const std::string& name) {
  ifreq request{};
  std::strncpy(request.ifr_name, name.c_str(), IFNAMSIZ - 1);
  return ioctl(Udp().handle(), SIOCGIFMTU, &request) == 0 ? request.ifr_mtu : 1500;
}

std::vector<Interface> read_interfaces() {
  std::vector<Interface> found;
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0) return found;
  for (const ifaddrs* one = all; one != nullptr; one = one->ifa_next) {
    auto same = std::ranges::find(found, std::string(one->ifa_name), &Interface::name);
    if (same == found.end()) {
      Interface made{.name = one->ifa_name};
      made.up = (one->ifa_flags & IFF_UP) != 0;
      made.running = (one->ifa_flags & IFF_RUNNING) != 0;
      made.loopback = (one->ifa_flags & IFF_LOOPBACK) != 0;
      made.mtu = mtu_of(made.name);
      same = found.insert(found.end(), made);
    }
    if (one->ifa_addr != nullptr && one->ifa_addr->sa_family == AF_INET && same->address.empty())
      same->address = text_of(one->ifa_addr);
  }
  freeifaddrs(all);
  return found;
}

/// Finds the address of a name, or why there is none. A name server that does not answer is not awaited.
void resolve(Peer& peer) {
  using Answer = std::pair<std::string, std::string>;
  auto promise = std::make_shared<std::promise<Answer>>();
  std::future<Answer> answer = promise->get_future();
  std::thread([promise, host = peer.host] {
    addrinfo hints{};
    hints.ai_family = AF_INET;
    hints.ai_socktype = SOCK_DGRAM;
    addrinfo* found = nullptr;
    const int code = getaddrinfo(host.c_str(), nullptr, &hints, &found);
    promise->set_value(code != 0 ? Answer{"", gai_strerror(code)} : Answer{text_of(found->ai_addr), ""});
    if (code == 0) freeaddrinfo(found);
  }).detach();
  if (answer.wait_for(1s) == std::future_status::ready) {
    std::tie(peer.address, peer.fault) = answer.get();
  } else {
    peer.fault = "the name server does not answer within 1 s";
  }
}

/// Own address from which the kernel sends to this one; empty: there is no route.
std::string source_address(const std::string& to) {
  const Udp udp;
  constexpr int kAnyPort = 9;
  sockaddr_in own{};
  socklen_t size = sizeof own;
  const bool routed =
      udp.connect_to("", to, kAnyPort) && getsockname(udp.handle(), reinterpret_cast<sockaddr*>(&own), &size) == 0;
  return routed ? text_of(reinterpret_cast<const sockaddr*>(&own)) : "";
}

Peer examine(const std::string& host, const std::vector<Interface>& interfaces) {
  Peer peer{.host = host};
  resolve(peer);
  if (peer.address.empty()) return peer;
  const auto with_address = [&](const std::string& text) {
    return std::ranges::find(interfaces, text, &Interface::address);
  };
  peer.own = !is_remote(peer.address) || with_address(peer.address) != interfaces.end();
  const std::string source = source_address(peer.address);
  if (!source.empty() && with_address(source) != interfaces.end()) peer.route = with_address(source)->name;
  return peer;
}

/// Sends so many bytes, and waits 50 ms for the answer that the port is closed.
bool is_refused(const Udp& udp, int bytes) {
  constexpr int kWait_ms = 50;
  const auto is_refusal = [](ssize_t result) { return result < 0 && errno == ECONNREFUSED; };
  const std::vector<char> payload(static_cast<std::size_t>(bytes));
  if (is_refusal(send(udp.handle(), payload.data(), payload.size(), 0))) return true;
  pollfd ready{.fd = udp.handle(), .events = POLLIN, .revents = 0};
  if (poll(&ready, 1, kWait_ms) <= 0) return false;
  char nothing = 0;
  return is_refusal(recv(udp.handle(), &nothing, sizeof nothing, MSG_DONTWAIT));
}

/// Sends datagrams to a closed port of the domain: as long as the MTU, which no router may fragment; after a second
/// also short ones. Linux answers a host once a second, after a burst of six, and programs that search for their peers
/// use up answers.
void probe(Peer& peer, const Interface& from, int port) {
  constexpr int kHeaders = 28, kLongest = 65'535, kShort = 16, kNeverFragment = IP_PMTUDISC_PROBE;
  const Udp longest, brief;
  peer.refuses = peer.refuses_full_size = false;
  for (const Udp* one : {&longest, &brief}) {
    if (!one->connect_to(from.address, peer.address, port)) return;
  }
  setsockopt(longest.handle(), IPPROTO_IP, IP_MTU_DISCOVER, &kNeverFragment, sizeof kNeverFragment);
  const auto begin = std::chrono::steady_clock::now();
  for (auto since = 0ns; since < 3s && !peer.refuses_full_size; since = std::chrono::steady_clock::now() - begin) {
    peer.refuses_full_size = is_refused(longest, std::min(from.mtu, kLongest) - kHeaders);
    peer.refuses = peer.refuses || peer.refuses_full_size || (since > 1s && is_refused(brief, kShort));
  }
}

/// Whether the kernel asked the own network for an address and had no answer.
bool is_absent_neighbour(const std::string& address) {
  std::istringstream lines(file_text("/proc/net/arp"));
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string ip, type, flags;
    if (words >> ip >> type >> flags && ip == address) return flags == "0x0";
  }
  return false;
}

}  // namespace

void read_network(const Request& request, NetworkFacts& network) {
  network.interfaces = read_interfaces();
  if (!request.network.secure.empty()) {
    network.key_faults = key_faults(request.network.secure);
    network.keys_of_users = users_with_keys(request.network.secure);
  }
  std::vector<std::future<Peer>> answers;
  for (const std::string& host : request.network.peers)
    answers.push_back(std::async(std::launch::async, [&, host] { return examine(host, network.interfaces); }));
  for (auto& answer : answers) network.peers.push_back(answer.get());
}

void probe_peers(const Request& request, int domain, NetworkFacts& network) {
  const Interface* const from = own_interface(request, network);
  if (from == nullptr || from->address.empty() || from->loopback || !from->running) return;
  const int unused_port = first_port(domain) + 10 + 2 * participant_room(domain) - 1;
  std::vector<std::future<void>> probes;
  for (Peer& peer : network.peers) {
    if (peer.address.empty() || peer.own || peer.route != from->name) continue;
    probes.push_back(std::async(std::launch::async, [&peer, from, unused_port] {
      probe(peer, *from, unused_port);
      peer.neighbour_absent = is_absent_neighbour(peer.address);
    }));
  }
  for (auto& one : probes) one.get();
}

}  // namespace subworld::doctor
