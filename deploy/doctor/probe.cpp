#include "doctor/probe.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/ip_icmp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <ctime>
#include <optional>
#include <sstream>
#include <vector>

namespace subworld::doctor {

namespace {

using ProbeClock = std::chrono::steady_clock;
constexpr double kPatience_s = 1.2;  ///< longer than the interval at which Linux answers for closed ports
constexpr int kRepeat_ms = 200;
constexpr int kIpHeaderBytes = 20, kIcmpHeaderBytes = 8;

sockaddr_in address_of(const std::string& text, int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  inet_pton(AF_INET, text.c_str(), &address.sin_addr);
  return address;
}

/// A socket that closes itself.
class Socket {
 public:
  Socket(int type, int protocol) : handle_(socket(AF_INET, type | SOCK_CLOEXEC, protocol)) {}
  ~Socket() {
    if (handle_ >= 0) close(handle_);
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  [[nodiscard]] int handle() const { return handle_; }
  [[nodiscard]] bool open() const { return handle_ >= 0; }
  bool connect_to(const sockaddr_in& to) const {
    return connect(handle_, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0;
  }
  bool bind_to(const sockaddr_in& from) const {
    return bind(handle_, reinterpret_cast<const sockaddr*>(&from), sizeof from) == 0;
  }

 private:
  int handle_;
};

std::uint16_t checksum(const std::vector<std::uint8_t>& bytes) {
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i < bytes.size(); i += 2)
    sum += static_cast<std::uint32_t>(bytes[i] << 8U) + (i + 1 < bytes.size() ? bytes[i + 1] : 0U);
  while (sum >> 16U != 0) sum = (sum & 0xffffU) + (sum >> 16U);
  return static_cast<std::uint16_t>(~sum);
}

std::uint32_t milliseconds_of_day() {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return static_cast<std::uint32_t>(now.tv_sec % 86'400) * 1000U + static_cast<std::uint32_t>(now.tv_nsec / 1'000'000);
}

std::vector<std::uint8_t> request(std::uint8_t type, std::uint16_t number, std::size_t payload_bytes) {
  std::vector<std::uint8_t> bytes(kIcmpHeaderBytes + payload_bytes);
  icmphdr header{};
  header.type = type;
  header.un.echo.id = htons(static_cast<std::uint16_t>(getpid()));
  header.un.echo.sequence = htons(number);
  std::memcpy(bytes.data(), &header, sizeof header);
  if (type == ICMP_TIMESTAMP) {
    const std::uint32_t now = htonl(milliseconds_of_day());
    std::memcpy(bytes.data() + kIcmpHeaderBytes, &now, sizeof now);
  }
  const std::uint16_t sum = htons(checksum(bytes));
  std::memcpy(bytes.data() + 2, &sum, sizeof sum);
  return bytes;
}

constexpr std::uint16_t kSmall = 1, kFull = 2, kTime = 3;

/// The requests of ICMP that a host has answered.
struct Echoes {
  bool possible = false, small = false, full = false;
  bool refused = false;  ///< a port of the domain is closed, and says so
  std::optional<double> clock_offset_s;
  double round_trip_s = 0.0;
};

void read_echo(const std::vector<std::uint8_t>& bytes, ProbeClock::time_point sent, Echoes& echoes) {
  icmphdr header{};
  if (bytes.size() < sizeof header) return;
  std::memcpy(&header, bytes.data(), sizeof header);
  const std::uint16_t number = ntohs(header.un.echo.sequence);
  if (header.type == ICMP_ECHOREPLY && number == kSmall) echoes.small = true;
  if (header.type == ICMP_ECHOREPLY && number == kFull) echoes.full = true;
  if (header.type != ICMP_TIMESTAMPREPLY || bytes.size() < kIcmpHeaderBytes + 12U) return;
  std::uint32_t originate = 0, transmit = 0;
  std::memcpy(&originate, bytes.data() + kIcmpHeaderBytes, sizeof originate);
  std::memcpy(&transmit, bytes.data() + kIcmpHeaderBytes + 8, sizeof transmit);
  echoes.round_trip_s = std::chrono::duration<double>(ProbeClock::now() - sent).count();
  constexpr std::uint32_t kNoStandardTime = 1U << 31U;  // the highest bit says so (RFC 792)
  if ((ntohl(transmit) & kNoStandardTime) != 0) return;
  constexpr double kDay_s = 86'400.0;
  const double apart_s =
      std::remainder(1e-3 * (static_cast<double>(ntohl(transmit)) - static_cast<double>(ntohl(originate))), kDay_s);
  echoes.clock_offset_s = apart_s - 0.5 * echoes.round_trip_s;
}

/// Whether a message says that a UDP port of the domain is closed. It holds the datagram that it answers.
bool is_refusal(const std::vector<std::uint8_t>& bytes, int domain) {
  const std::size_t inner = kIcmpHeaderBytes;
  if (bytes.size() < inner + kIpHeaderBytes || bytes[0] != ICMP_DEST_UNREACH || bytes[1] != ICMP_PORT_UNREACH)
    return false;
  const std::size_t udp = inner + 4U * (bytes[inner] & 15U);
  if (bytes[inner + 9] != IPPROTO_UDP || bytes.size() < udp + 4) return false;
  const int port = (bytes[udp + 2] << 8) + bytes[udp + 3];
  return port >= first_port(domain) && port < first_port(domain) + kPortsOfDomain;
}

/// The next message, without its IP header; empty: none within the time.
std::vector<std::uint8_t> receive(const Socket& raw, int timeout_ms) {
  pollfd ready{.fd = raw.handle(), .events = POLLIN, .revents = 0};
  if (poll(&ready, 1, timeout_ms) <= 0) return {};
  std::vector<std::uint8_t> bytes(65'536);
  const ssize_t size = recv(raw.handle(), bytes.data(), bytes.size(), 0);
  const std::size_t header = size > 0 ? 4U * (bytes[0] & 15U) : 0U;
  if (size < 0 || static_cast<std::size_t>(size) < header + kIcmpHeaderBytes) return {};
  return {bytes.begin() + static_cast<long>(header), bytes.begin() + size};
}

void send_requests(const Socket& raw, const Interface& from) {
  const int longest = std::max(0, std::min(from.mtu, 65'535) - kIpHeaderBytes - kIcmpHeaderBytes);
  for (const auto& bytes : {request(ICMP_TIMESTAMP, kTime, 12), request(ICMP_ECHO, kSmall, 16),
                            request(ICMP_ECHO, kFull, static_cast<std::size_t>(longest))})
    (void)send(raw.handle(), bytes.data(), bytes.size(), 0);
}

Echoes exchange(const Peer& peer, const Interface& from, int domain) {
  Echoes echoes;
  const Socket raw(SOCK_RAW, IPPROTO_ICMP), udp(SOCK_DGRAM, 0);
  const int unused_port = first_port(domain) + 10 + 2 * participant_room(domain) - 1;
  if (!raw.open() || !raw.bind_to(address_of(from.address, 0)) || !raw.connect_to(address_of(peer.address, 0)) ||
      !udp.bind_to(address_of(from.address, 0)))
    return echoes;
  echoes.possible = true;
  const int never_fragment = IP_PMTUDISC_PROBE;
  setsockopt(raw.handle(), IPPROTO_IP, IP_MTU_DISCOVER, &never_fragment, sizeof never_fragment);
  const sockaddr_in unused = address_of(peer.address, unused_port);
  const std::uint16_t id = htons(static_cast<std::uint16_t>(getpid()));
  const auto begin = ProbeClock::now();
  send_requests(raw, from);
  for (auto sent = begin - std::chrono::seconds(1);
       !(echoes.small && echoes.full && echoes.clock_offset_s && echoes.refused);) {
    const auto now = ProbeClock::now();
    if (std::chrono::duration<double>(now - begin).count() > kPatience_s) break;
    if (now - sent >= std::chrono::milliseconds(kRepeat_ms)) {
      const char nothing = 0;
      (void)sendto(udp.handle(), &nothing, sizeof nothing, 0, reinterpret_cast<const sockaddr*>(&unused),
                   sizeof unused);
      sent = now;
    }
    const std::vector<std::uint8_t> message = receive(raw, kRepeat_ms);
    if (message.empty()) continue;
    echoes.refused |= is_refusal(message, domain);
    if (std::memcmp(message.data() + 4, &id, sizeof id) == 0) read_echo(message, begin, echoes);
  }
  return echoes;
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

std::string source_address(const std::string& to) {
  const Socket udp(SOCK_DGRAM, 0);
  constexpr int kAnyPort = 9;
  if (!udp.connect_to(address_of(to, kAnyPort))) return {};
  sockaddr_in own{};
  socklen_t size = sizeof own;
  if (getsockname(udp.handle(), reinterpret_cast<sockaddr*>(&own), &size) != 0) return {};
  std::array<char, INET_ADDRSTRLEN> text{};
  inet_ntop(AF_INET, &own.sin_addr, text.data(), text.size());
  return text.data();
}

void probe(Peer& peer, const Interface& from, int domain) {
  const Echoes echoes = exchange(peer, from, domain);
  if (!echoes.possible) return;
  peer.ports_refuse = echoes.refused;
  peer.pings = echoes.small;
  peer.pings_full_size = !echoes.small || echoes.full;
  peer.clock_offset_s = echoes.clock_offset_s;
  peer.clock_uncertainty_s = 0.5 * echoes.round_trip_s + 1e-3;
  peer.neighbour_absent = is_absent_neighbour(peer.address);
}

}  // namespace subworld::doctor
