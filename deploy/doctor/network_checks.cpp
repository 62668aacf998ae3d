#include "doctor/checks.hpp"
#include "model/joined.hpp"
#include "model/shapes/nearest.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cstdlib>

namespace subworld::doctor {

namespace {

bool has_remote_peer(const Facts& facts) { return std::ranges::any_of(facts.request.network.peers, is_remote); }

/// The command line with another interface: the one that leads to the peers, else the first that leads anywhere.
std::string with_interface(const Facts& facts) {
  Request request = facts.request;
  std::string& name = request.network.interface_address;
  name.clear();
  for (const Peer& peer : facts.network.peers) {
    if (!peer.own && !peer.route.empty() && peer.route != "lo") name = peer.route;
  }
  for (const Interface& one : facts.network.interfaces) {
    if (name.empty() && one.running && !one.loopback && !one.address.empty()) name = one.name;
  }
  return command_of(request);
}

std::string with_free_domain(const Facts& facts) {
  Request request = facts.request;
  request.domain = facts.domain.free_domain;
  return command_of(request);
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

/// Of an interface that exists.
void judge_own_interface(const Facts& facts, const Interface& own, Findings& out) {
  if (!own.up) {
    out.push_back({.what = fmt::format("the interface {} is down", own.name),
                   .why = "nothing is sent or received on it",
                   .cure = fmt::format("{}ip link set {} up", as_root(facts), own.name)});
  } else if (!own.running) {
    out.push_back(
        {.what = fmt::format("the interface {} is up, but has no signal from the other end", own.name),
         .why = "the cable is unplugged, or the other end is down",
         .cure = fmt::format("ip monitor link dev {}  # shows LOWER_UP when the other end is there", own.name)});
  } else if (own.address.empty()) {
    out.push_back({.what = fmt::format("the interface {} has no IPv4 address", own.name),
                   .why = "both DDS vendors use IPv4 here. Choose an address that no other host has",
                   .cure = fmt::format("{}ip address add {} dev {}", as_root(facts), address_for(facts), own.name)});
  }
}

void judge_interface(const Facts& facts, Findings& out) {
  const Network& network = facts.request.network;
  const std::string& wanted = network.interface_address;
  const auto& all = facts.network.interfaces;
  const Interface* own = own_interface(facts.request, facts.network);
  const bool unnamed = wanted.empty() && network.qos_file.empty();
  if (has_remote_peer(facts) && (unnamed || (own != nullptr && own->loopback))) {
    out.push_back({.what = fmt::format("--peers {} {}", joined(network.peers, ","),
                                       unnamed ? "needs --interface" : "is out of reach of --interface loopback"),
                   .why = "the default interface is loopback, which reaches this host only; programs refuse the peers",
                   .cure = with_interface(facts)});
  } else if (own != nullptr) {
    judge_own_interface(facts, *own, out);
  } else if (wanted.empty()) {
    const auto loopback = std::ranges::find(all, true, &Interface::loopback);
    if (loopback != all.end()) judge_own_interface(facts, *loopback, out);
  } else {
    std::vector<std::string_view> names;
    for (const Interface& one : all) names.push_back(one.name);
    Request near = facts.request;
    near.network.interface_address = nearest(wanted, names);
    out.push_back({.what = fmt::format("--interface {}: this machine has {}", wanted, joined(names, ", ")),
                   .why = "a program refuses an interface that does not exist",
                   .cure = near.network.interface_address.empty() ? with_interface(facts) : command_of(near)});
  }
}

/// One host needs what every kernel has; messages of several hosts arrive in bursts.
void judge_buffers(const Facts& facts, Findings& out) {
  constexpr std::int64_t kOfOneHost = 208 << 10, kReceive = 4 << 20, kSend = 1 << 20;
  const auto judge = [&](std::int64_t bytes, std::int64_t wanted, const char* name, const char* effect) {
    if (bytes >= (has_remote_peer(facts) ? wanted : kOfOneHost)) return;
    out.push_back({.what = fmt::format("net.core.{} is {} bytes; the programs ask for {}", name, bytes, wanted),
                   .why = effect,
                   .cure = fmt::format("{}sysctl -w net.core.{}={}", as_root(facts), name, wanted)});
  };
  judge(facts.machine.receive_buffer_bytes, kReceive, "rmem_max",
        "the kernel drops messages that arrive in a burst, and frames are lost");
  judge(facts.machine.send_buffer_bytes, kSend, "wmem_max",
        "a large message waits for the network, and the loop drops it");
}

void judge_names(const Facts& facts, Findings& out) {
  for (const Peer& peer : facts.network.peers) {
    if (!peer.address.empty()) continue;
    Request without = facts.request;
    std::erase(without.network.peers, peer.host);
    out.push_back({.what = fmt::format("--peers: the host {} has no address: {}", peer.host, peer.fault),
                   .why = "programs refuse it; give its IPv4 address, or go on without it",
                   .cure = command_of(without)});
  }
}

void judge_own_addresses(const Facts& facts, Findings& out) {
  const auto& peers = facts.network.peers;
  if (peers.empty() || !std::ranges::all_of(peers, [](const Peer& one) { return one.own && is_remote(one.host); }))
    return;
  Request alone = facts.request;
  alone.network.peers.clear();
  out.push_back({.what = fmt::format("--peers names this host only: {} is an own address", peers.front().host),
                 .why = "no other host is searched for. Give the address of the other host, or run on this host alone",
                 .cure = command_of(alone)});
}

/// Hosts to which messages leave by --interface, or should. None where the interface itself is at fault.
std::vector<Peer> others(const Facts& facts, bool routed) {
  std::vector<Peer> found;
  const Interface* own = own_interface(facts.request, facts.network);
  if (own == nullptr || !own->running || own->address.empty() || own->loopback) return found;
  for (const Peer& peer : facts.network.peers) {
    if (!peer.address.empty() && !peer.own && (peer.route == own->name) == routed) found.push_back(peer);
  }
  return found;
}

void judge_routes(const Facts& facts, Findings& out) {
  for (const Peer& peer : others(facts, false)) {
    const std::string& own = own_interface(facts.request, facts.network)->name;
    out.push_back(
        {.what = peer.route.empty()
                     ? fmt::format("there is no route to {}", peer.host)
                     : fmt::format("the route to {} leaves by {}, not by --interface {}", peer.host, peer.route, own),
         .why = "messages do not reach the host, or its answers go to another address of this one, without a program",
         .cure = fmt::format("{}ip route replace {}/32 dev {}", as_root(facts), peer.address, own)});
  }
}

void judge_presence(const Facts& facts, Findings& out) {
  for (const Peer& peer : others(facts, true)) {
    if (!peer.neighbour_absent || peer.refuses) continue;
    out.push_back({.what = fmt::format("{} is not there: no host of this network answers for its address", peer.host),
                   .why = "it is switched off, on another network, or has another address",
                   .cure = fmt::format("ip -brief address  # on {}: it must show {} on an interface that is UP",
                                       peer.host, peer.address)});
  }
}

/// Of the domain in question, else of the first one that a run takes.
int examined_domain(const Facts& facts) {
  constexpr int kFirstChosen = 100;
  return facts.domain.number.value_or(kFirstChosen);
}

void judge_firewall(const Facts& facts, Findings& out) {
  const int first = first_port(examined_domain(facts));
  for (const Peer& peer : others(facts, true)) {
    if (peer.neighbour_absent || peer.refuses) continue;
    out.push_back({.what = fmt::format("{} does not answer that an unused UDP port of the domain is closed", peer.host),
                   .why = "a firewall drops the messages, without a reply; or, behind a router, the host is off",
                   .cure = fmt::format("ssh {} sudo nft insert rule inet filter input udp dport {}-{} accept",
                                       peer.host, first, first + kPortsOfDomain - 1)});
  }
}

void judge_path_mtu(const Facts& facts, Findings& out) {
  for (const Peer& peer : others(facts, true)) {
    if (!peer.refuses || peer.refuses_full_size) continue;
    const Interface& own = *own_interface(facts.request, facts.network);
    out.push_back(
        {.what = fmt::format("packets of {} bytes, the MTU of {}, do not reach {}; small ones do", own.mtu, own.name,
                             peer.host),
         .why = "large messages are lost, small ones arrive: programs find each other, and frames do not come",
         .cure = fmt::format("{}ip link set {} mtu {}", as_root(facts), own.name, own.mtu > 1500 ? 1500 : 1280)});
  }
}

void judge_keys(const Facts& facts, Findings& out) {
  const std::string& folder = facts.request.network.secure;
  for (const std::string& fault : facts.network.key_faults) {
    out.push_back({.what = fault,
                   .why = "a program with these keys does not start, or no other program hears it",
                   .cure = fmt::format("subworld keys make {} --users {}  # and use it on all hosts; or copy the "
                                       "role's folder from where the keys were made",
                                       shell_word(folder + "_new"), std::max(1, facts.network.keys_of_users))});
  }
  for (const RunningProgram& one : facts.domain.programs) {
    const auto keys = value_of(one.words, "--secure");
    if (!keys || !folder.empty() || one.domain != facts.domain.number) continue;
    Request with = facts.request;
    with.network.secure = *keys;
    out.push_back({.what = fmt::format("the run on domain {} has keys", one.domain),
                   .why = "the doctor hears nothing of it without them",
                   .cure = command_of(with)});
    return;
  }
}

/// Where the vendor's library, the interface or a peer is at fault, that is the cause.
void judge_joining(const Facts& facts, Findings& out) {
  const std::string& fault = facts.domain.fault;
  constexpr std::array<std::string_view, 4> kCauses{"installation", "interface", "peer_names", "keys"};
  const bool explained = std::ranges::any_of(
      out, [&](const Finding& one) { return std::ranges::find(kCauses, one.check) != kCauses.end(); });
  if (fault.empty() || explained) return;
  std::string cure = with_free_domain(facts);
  for (const auto& [name, vendor] : wire::kVendorVariables) {
    const std::string* value = vendor ? variable(facts, name) : nullptr;
    if (value != nullptr && fault.find(*value) != std::string::npos) cure = fmt::format("unset {}", name);
  }
  Request without = facts.request;
  without.network.qos_file.clear();
  const std::string& file = facts.request.network.qos_file;
  if (!file.empty() && fault.find(file) != std::string::npos) cure = command_of(without);
  out.push_back({.what = fault, .why = "no program can take part in a run here", .cure = cure});
}

void judge_ephemeral_ports(const Facts& facts, Findings& out) {
  constexpr int kUsualFirst = 32'768;
  const int domain = examined_domain(facts), begin = first_port(domain), end = begin + kPortsOfDomain;
  const auto [first, last] = facts.machine.ephemeral_ports;
  if (end <= first || begin > last) return;
  out.push_back(
      {.what = fmt::format("the UDP ports {} to {} of domain {} are among those that Linux gives to any program "
                           "({} to {})",
                           begin, end - 1, domain, first, last),
       .why = "now and then another socket has one of them, and a program does not find its peers",
       .cure = first < kUsualFirst
                   ? fmt::format("{}sysctl -w net.ipv4.ip_local_port_range='32768 60999'", as_root(facts))
                   : with_free_domain(facts)});
}

void judge_foreign_ports(const Facts& facts, Findings& out) {
  const auto& ports = facts.domain.foreign_ports;
  if (ports.empty()) return;
  const ForeignPort& first = ports.front();
  const std::string owner =
      first.pid == 0 ? "a program of another user" : fmt::format("{} (process {})", first.name, first.pid);
  out.push_back(
      {.what = fmt::format("{} has UDP port {} of domain {}{}", owner, first.port, *facts.domain.number,
                           ports.size() == 1 ? "" : fmt::format(", and {} more are in use", ports.size() - 1)),
       .why = "each takes the place of a program of the run; it may be a DDS program of another system",
       .cure = with_free_domain(facts)});
}

void judge_ros_domain(const Facts& facts, Findings& out) {
  const std::string* ros = variable(facts, "ROS_DOMAIN_ID");
  if (ros == nullptr || !facts.domain.number || *ros != std::to_string(*facts.domain.number)) return;
  out.push_back(
      {.what = fmt::format("ROS uses domain {} too (ROS_DOMAIN_ID)", *ros),
       .why = "programs of both systems search for each other all the time, and share the ports of the domain",
       .cure = with_free_domain(facts)});
}

constexpr std::array kNetworkChecks{
    Check{"interface",
          "--interface, or else loopback, exists, is up and has a signal and an IPv4 address; with --peers it is not "
          "loopback",
          judge_interface},
    Check{"socket_buffers",
          "sockets may have 208 KiB, and with --peers what the programs ask for: 4 MiB to receive, 1 MiB to send",
          judge_buffers},
    Check{"peer_names", "each host of --peers is an IPv4 address or a name that resolves to one", judge_names},
    Check{"peers_are_others", "--peers names a host other than this one", judge_own_addresses},
    Check{"route", "the route to each peer leaves by --interface", judge_routes},
    Check{"peer_present", "each peer on the same network answers for its address", judge_presence},
    Check{"firewall", "a UDP port of the domain that no program uses refuses a message: nothing filters it",
          judge_firewall},
    Check{"path_mtu", "packets as long as the MTU reach each peer", judge_path_mtu},
    Check{"keys", "the keys of --secure are valid, of one authority, and belong together", judge_keys},
    Check{"joining", "a participant of the vendor can join the domain, with the file of --qos", judge_joining},
    Check{"ephemeral_ports", "the domain's ports are not among those that Linux gives to any socket",
          judge_ephemeral_ports},
    Check{"foreign_ports", "no other program has a port of the domain", judge_foreign_ports},
    Check{"ros_domain", "ROS uses another domain (`ROS_DOMAIN_ID`)", judge_ros_domain}};

}  // namespace

std::span<const Check> network_checks() { return kNetworkChecks; }

}  // namespace subworld::doctor
