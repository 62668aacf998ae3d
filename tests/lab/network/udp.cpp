#include "lab/network/udp.hpp"

#include "model/error.hpp"

#include <arpa/inet.h>
#include <fmt/core.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <vector>

namespace subworld {

namespace {

constexpr int kPoll_ms = 5;
// Between the ports that DDS uses in a domain and those of the next one.
constexpr int kFirstPort = 7400, kPortsOfDomain = 250, kPortsThere = 90, kPortsBack = 110;

/// What DDS reports when endpoints have found each other.
struct FoundEachOther {
  int current_count = 1;
  int current_count_change = 1;
};

sockaddr_in udp_address(const std::string& address, int port) {
  sockaddr_in in{};
  in.sin_family = AF_INET;
  in.sin_port = htons(static_cast<std::uint16_t>(port));
  inet_pton(AF_INET, address.c_str(), &in.sin_addr);
  return in;
}

class UdpSocket {
 public:
  UdpSocket() : number_(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {
    if (number_ < 0) throw Error(ExitCode::failed, fmt::format("UDP socket: {}", std::strerror(errno)));
  }
  ~UdpSocket() { close(number_); }
  UdpSocket(const UdpSocket&) = delete;
  UdpSocket& operator=(const UdpSocket&) = delete;
  [[nodiscard]] int get() const { return number_; }

 private:
  int number_;
};

class UdpWriter final : public wire::BackendWriter {
 public:
  UdpWriter(const sockaddr_in& to, wire::EventSink& events) : BackendWriter("udp", events), to_(to) {
    match(FoundEachOther{});
  }
  bool write(std::span<const std::uint8_t> cdr) noexcept override {
    return sendto(socket_.get(), cdr.data(), cdr.size(), 0, reinterpret_cast<const sockaddr*>(&to_), sizeof to_) >= 0;
  }
  bool wait_for_acknowledgments(double) noexcept override { return true; }

 private:
  UdpSocket socket_;
  sockaddr_in to_;
};

class UdpReader final : public wire::BackendReader {
 public:
  UdpReader(const sockaddr_in& at, wire::EventSink& events) : BackendReader("udp", events) {
    const int bytes = 1 << 20;
    setsockopt(socket_.get(), SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
    if (bind(socket_.get(), reinterpret_cast<const sockaddr*>(&at), sizeof at) != 0)
      throw Error(ExitCode::failed,
                  fmt::format("UDP port {}: {}; choose another --domain", ntohs(at.sin_port), std::strerror(errno)));
    match(FoundEachOther{});
  }
  bool take(std::vector<std::uint8_t>& cdr, std::uint64_t& writer) noexcept override {
    writer = 0;
    cdr.resize(kMostDatagram_bytes);
    const ssize_t size = recv(socket_.get(), cdr.data(), cdr.size(), 0);
    if (size < 0) return false;
    cdr.resize(size);
    return true;
  }
  [[nodiscard]] int socket_number() const { return socket_.get(); }

 private:
  UdpSocket socket_;
};

class PlainUdp final : public UdpBackend {
 public:
  PlainUdp(const PeerPlan& plan, int number, wire::EventSink& events) : plan_(plan), number_(number), events_(events) {}

  std::unique_ptr<wire::BackendWriter> create_writer(const wire::EndpointSpec& spec) override {
    const int user = user_of(spec);
    const std::size_t peer = number_ == 0 ? user : 0;
    return std::make_unique<UdpWriter>(
        udp_address(plan_.peers.empty() ? wire::kDefaultInterface : plan_.peers[peer], port(number_ == 0, user)),
        events_);
  }
  std::unique_ptr<wire::BackendReader> create_reader(const wire::EndpointSpec& spec) override {
    const std::string& mine = plan_.interface_address;
    auto reader = std::make_unique<UdpReader>(
        udp_address(mine.empty() ? wire::kDefaultInterface : mine, port(number_ != 0, user_of(spec))), events_);
    polled_.push_back({.fd = reader->socket_number(), .events = POLLIN, .revents = 0});
    return reader;
  }
  void wait() noexcept override { poll(polled_.data(), polled_.size(), kPoll_ms); }

 private:
  static int user_of(const wire::EndpointSpec& spec) {
    return std::stoi(spec.partition.substr(spec.partition.find('_') + 1));
  }
  [[nodiscard]] int port(bool there, int user) const {
    return kFirstPort + kPortsOfDomain * plan_.domain + (there ? kPortsThere : kPortsBack) + user;
  }

  const PeerPlan& plan_;
  int number_;
  wire::EventSink& events_;
  std::vector<pollfd> polled_;
};

}  // namespace

std::unique_ptr<UdpBackend> open_udp(const PeerPlan& plan, int number, wire::EventSink& events) {
  return std::make_unique<PlainUdp>(plan, number, events);
}

}  // namespace subworld
