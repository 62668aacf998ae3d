#include "doctor/checks.hpp"
#include "model/joined.hpp"
#include "model/nearest.hpp"
#include "tools.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>

namespace subworld::doctor {

namespace {

using Findings = std::vector<Finding>;

bool has_remote_peer(const Facts& facts) { return std::ranges::any_of(facts.request.network.peers, is_remote); }

/// The command line with another interface: the one that leads to the peers, else the first that leads anywhere.
std::string with_interface(const Facts& facts) {
  Request request = facts.request;
  request.network.interface_address.clear();
  for (const Peer& peer : facts.network.peers) {
    if (!peer.own && !peer.route.empty() && peer.route != "lo") request.network.interface_address = peer.route;
  }
  for (const Interface& one : facts.network.interfaces) {
    if (request.network.interface_address.empty() && one.running && !one.loopback && !one.address.empty())
      request.network.interface_address = one.name;
  }
  return command_of(request);
}

void judge_loopback(const Facts& facts, Findings& out) {
  for (const Interface& one : facts.network.interfaces) {
    if (!one.loopback || one.up || !facts.request.network.interface_address.empty()) continue;
    out.push_back({.what = fmt::format("the loopback interface {} is down", one.name),
                   .why = "the programs of one host exchange their messages over it",
                   .cure = fmt::format("{}ip link set {} up", as_root(facts), one.name)});
  }
}

void judge_peers_need_interface(const Facts& facts, Findings& out) {
  const Network& network = facts.request.network;
  const Interface* own = own_interface(facts);
  const bool unnamed = network.interface_address.empty() && network.qos_file.empty();
  if (!has_remote_peer(facts) || (!unnamed && (own == nullptr || !own->loopback))) return;
  out.push_back({.what = fmt::format("--peers {} {}", joined(network.peers, ","),
                                     unnamed ? "needs --interface" : "is out of reach of --interface loopback"),
                 .why = "the default interface is loopback, which reaches this host only; programs refuse the peers",
                 .cure = with_interface(facts)});
}

void judge_interface_exists(const Facts& facts, Findings& out) {
  const std::string& wanted = facts.request.network.interface_address;
  if (wanted.empty() || own_interface(facts) != nullptr) return;
  std::vector<std::string_view> names;
  for (const Interface& one : facts.network.interfaces) names.push_back(one.name);
  Request request = facts.request;
  request.network.interface_address = nearest(wanted, names);
  const bool slip = !request.network.interface_address.empty();
  out.push_back({.what = fmt::format("--interface {}: this machine has {}", wanted, joined(names, ", ")),
                 .why = "a program refuses an interface that does not exist",
                 .cure = slip ? command_of(request) : with_interface(facts)});
}

void judge_interface_up(const Facts& facts, Findings& out) {
  const Interface* own = own_interface(facts);
  if (own == nullptr || own->loopback || own->up) return;
  out.push_back({.what = fmt::format("--interface {} is down", own->name),
                 .why = "nothing is sent or received on it",
                 .cure = fmt::format("{}ip link set {} up", as_root(facts), own->name)});
}

void judge_carrier(const Facts& facts, Findings& out) {
  const Interface* own = own_interface(facts);
  if (own == nullptr || own->loopback || !own->up || own->running) return;
  out.push_back(
      {.what = fmt::format("--interface {} is up, but has no signal from the other end", own->name),
       .why = "the cable is unplugged, or the other end is down",
       .cure = fmt::format("ip monitor link dev {}  # shows LOWER_UP when the other end is there", own->name)});
}

/// An address in the network of the peers, or else a link-local one.
std::string address_for(const Facts& facts) {
  for (const Peer& peer : facts.network.peers) {
    if (peer.address.empty() || peer.own) continue;
    const std::size_t dot = peer.address.rfind('.');
    const int last = std::atoi(peer.address.c_str() + dot + 1);
    return fmt::format("{}.{}/24", peer.address.substr(0, dot), last < 250 ? last + 4 : last - 4);
  }
  return "169.254.77.1/16";
}

void judge_interface_address(const Facts& facts, Findings& out) {
  const Interface* own = own_interface(facts);
  if (own == nullptr || !own->up || !own->address.empty()) return;
  out.push_back({.what = fmt::format("--interface {} has no IPv4 address", own->name),
                 .why =
                     "both DDS vendors use IPv4 here; a program refuses the interface. Choose an address that no other "
                     "host has",
                 .cure = fmt::format("{}ip address add {} dev {}", as_root(facts), address_for(facts), own->name)});
}

constexpr int kLeastMtu = 1280;

void judge_mtu(const Facts& facts, Findings& out) {
  const Interface* own = own_interface(facts);
  if (own == nullptr || own->loopback || own->mtu >= kLeastMtu) return;
  constexpr int kDatagram = 65'500;
  out.push_back({.what = fmt::format("--interface {} has an MTU of {} bytes", own->name, own->mtu),
                 .why = fmt::format("a datagram of {} bytes needs {} packets, and is lost when one of them is",
                                    kDatagram, kDatagram / std::max(1, own->mtu) + 1),
                 .cure = fmt::format("{}ip link set {} mtu 1500", as_root(facts), own->name)});
}

/// One host needs what every kernel has; messages of several hosts arrive in bursts.
constexpr std::uint64_t kBufferOfOneHost = 208 << 10U;
constexpr std::uint64_t kReceiveBuffer = 4U << 20U, kSendBuffer = 1U << 20U;

void judge_buffer(const Facts& facts, std::uint64_t bytes, std::uint64_t wanted, const char* variable,
                  const char* effect, Findings& out) {
  const std::uint64_t least = has_remote_peer(facts) ? wanted : kBufferOfOneHost;
  if (bytes >= least) return;
  out.push_back({.what = fmt::format("net.core.{} is {} bytes; the programs ask for {}", variable, bytes, wanted),
                 .why = effect,
                 .cure = fmt::format("{}sysctl -w net.core.{}={}", as_root(facts), variable, wanted)});
}

void judge_buffers(const Facts& facts, Findings& out) {
  const Machine& machine = facts.machine;
  judge_buffer(facts, machine.receive_buffer_bytes, kReceiveBuffer, "rmem_max",
               "the kernel drops messages that arrive in a burst, and frames are lost", out);
  judge_buffer(facts, machine.send_buffer_bytes, kSendBuffer, "wmem_max",
               "a large message waits for the network, and the loop drops it", out);
}

void judge_qos_file(const Facts& facts, Findings& out) {
  const std::string& file = facts.request.network.qos_file;
  std::string fault = facts.network.qos_fault;
  const bool named = facts.domain.fault.find(file) != std::string::npos;
  if (fault.empty() && !facts.domain.opened && named) fault = facts.domain.fault;
  if (file.empty() || fault.empty()) return;
  Request request = facts.request;
  request.network.qos_file = program_folder() + "/qos/" + (request.dds == "mixed" ? "fastdds" : request.dds) + ".xml";
  out.push_back({.what = fault.find(file) == std::string::npos ? fmt::format("--qos {}: {}", file, fault) : fault,
                 .why = "a program ends that cannot read its settings",
                 .cure = command_of(request)});
}

constexpr std::array kNetworkChecks{
    Check{"loopback", "loopback is up, unless --interface names another interface", judge_loopback},
    Check{"peers_need_interface", "--peers has an --interface that is not loopback", judge_peers_need_interface},
    Check{"interface_exists", "--interface exists", judge_interface_exists},
    Check{"interface_up", "--interface is up", judge_interface_up},
    Check{"carrier", "--interface has a signal from the other end", judge_carrier},
    Check{"interface_address", "--interface has an IPv4 address", judge_interface_address},
    Check{"mtu", "the MTU of --interface is at least 1280 bytes", judge_mtu},
    Check{"socket_buffers",
          "sockets may have 208 KiB, and with --peers what the programs ask for: 4 MiB to receive, 1 MiB to send",
          judge_buffers},
    Check{"qos_file", "the file of --qos can be read, and the vendor accepts it", judge_qos_file}};

}  // namespace

std::span<const Check> network_checks() { return kNetworkChecks; }

}  // namespace subworld::doctor
