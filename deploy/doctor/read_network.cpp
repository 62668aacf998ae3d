#include "doctor/facts.hpp"
#include "doctor/probe.hpp"
#include "model/error.hpp"

#include <arpa/inet.h>
#include <fmt/core.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
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

int mtu_of(const std::string& name) {
  ifreq request{};
  std::strncpy(request.ifr_name, name.c_str(), IFNAMSIZ - 1);
  const int handle = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const bool known = ioctl(handle, SIOCGIFMTU, &request) == 0;
  close(handle);
  return known ? request.ifr_mtu : 1500;
}

std::vector<Interface> read_interfaces() {
  std::vector<Interface> found;
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0) return found;
  for (const ifaddrs* one = all; one != nullptr; one = one->ifa_next) {
    auto same = std::ranges::find(found, std::string(one->ifa_name), &Interface::name);
    if (same == found.end()) {
      Interface made{.name = one->ifa_name, .address = {}};
      made.up = (one->ifa_flags & IFF_UP) != 0;
      made.running = (one->ifa_flags & IFF_RUNNING) != 0;
      made.loopback = (one->ifa_flags & IFF_LOOPBACK) != 0;
      made.multicast = (one->ifa_flags & IFF_MULTICAST) != 0;
      made.mtu = mtu_of(made.name);
      same = found.insert(found.end(), made);
    }
    if (one->ifa_addr != nullptr && one->ifa_addr->sa_family == AF_INET && same->address.empty())
      same->address = text_of(one->ifa_addr);
  }
  freeifaddrs(all);
  return found;
}

/// Address of a name, or why there is none. A name server that does not answer is not awaited.
std::pair<std::string, std::string> resolve(const std::string& host) {
  using Answer = std::pair<std::string, std::string>;
  auto promise = std::make_shared<std::promise<Answer>>();
  std::future<Answer> answer = promise->get_future();
  std::thread([promise, host] {
    addrinfo hints{};
    hints.ai_family = AF_INET;
    hints.ai_socktype = SOCK_DGRAM;
    addrinfo* found = nullptr;
    if (const int code = getaddrinfo(host.c_str(), nullptr, &hints, &found); code != 0) {
      promise->set_value({"", gai_strerror(code)});
      return;
    }
    promise->set_value({text_of(found->ai_addr), ""});
    freeaddrinfo(found);
  }).detach();
  if (answer.wait_for(1s) != std::future_status::ready) return {"", "the name server does not answer within 1 s"};
  return answer.get();
}

/// The own interface that the command line names.
const Interface* chosen_interface(const Request& request, const std::vector<Interface>& interfaces) {
  const std::string& wanted = request.network.interface_address;
  const auto found = std::ranges::find_if(
      interfaces, [&](const Interface& one) { return one.name == wanted || one.address == wanted; });
  return found == interfaces.end() ? nullptr : &*found;
}

Peer examine(const std::string& host, const std::vector<Interface>& interfaces) {
  Peer peer{.host = host};
  std::tie(peer.address, peer.fault) = resolve(host);
  if (peer.address.empty()) return peer;
  peer.own =
      !is_remote(peer.address) || std::ranges::find(interfaces, peer.address, &Interface::address) != interfaces.end();
  peer.source = source_address(peer.address);
  const auto leaves_by = std::ranges::find(interfaces, peer.source, &Interface::address);
  if (!peer.source.empty() && leaves_by != interfaces.end()) peer.route = leaves_by->name;
  return peer;
}

std::vector<std::string> read_known_hosts() {
  std::vector<std::string> names;
  std::istringstream lines(file_text("/etc/hosts"));
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line.substr(0, line.find('#')));
    std::string address, name;
    words >> address;
    if (address.find(':') != std::string::npos) continue;
    while (words >> name) names.push_back(name);
  }
  return names;
}

}  // namespace

void read_network(const Request& request, NetworkFacts& network) {
  network.interfaces = read_interfaces();
  network.known_hosts = read_known_hosts();
  std::vector<std::future<Peer>> answers;
  for (const std::string& host : request.network.peers)
    answers.push_back(std::async(std::launch::async, [&, host] { return examine(host, network.interfaces); }));
  for (auto& answer : answers) network.peers.push_back(answer.get());
  if (const std::string& file = request.network.qos_file; !file.empty() && access(file.c_str(), R_OK) != 0)
    network.qos_fault = std::strerror(errno);
}

void probe_peers(const Request& request, int domain, NetworkFacts& network) {
  const Interface* const from = chosen_interface(request, network.interfaces);
  if (from == nullptr || from->address.empty() || from->loopback || !from->running) return;
  std::vector<std::future<void>> probes;
  for (Peer& peer : network.peers) {
    if (peer.address.empty() || peer.own || peer.route != from->name) continue;
    probes.push_back(std::async(std::launch::async, [&peer, from, domain] { probe(peer, *from, domain); }));
  }
  for (auto& one : probes) one.get();
}

}  // namespace subworld::doctor
