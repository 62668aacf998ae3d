#include "doctor/checks.hpp"
#include "model/nearest.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace subworld::doctor {

namespace {

using Findings = std::vector<Finding>;

/// Whether the peers were examined: where the own interface is at fault, they cannot answer.
bool are_examined(const Facts& facts) {
  const Interface* own = own_interface(facts);
  return own != nullptr && own->running && !own->address.empty() && !own->loopback;
}

/// The command line without a peer, or with another name for it.
std::string with_peer(const Facts& facts, const std::string& peer, const std::string& instead) {
  Request request = facts.request;
  std::vector<std::string>& peers = request.network.peers;
  if (instead.empty()) {
    std::erase(peers, peer);
  } else {
    std::ranges::replace(peers, peer, instead);
  }
  return command_of(request);
}

void judge_names(const Facts& facts, Findings& out) {
  for (const Peer& peer : facts.network.peers) {
    if (!peer.address.empty()) continue;
    std::vector<std::string_view> names(facts.network.known_hosts.begin(), facts.network.known_hosts.end());
    const std::string near(nearest(peer.host, names));
    out.push_back({.what = fmt::format("--peers: the host {} has no address: {}", peer.host, peer.fault),
                   .why = near.empty() ? "programs refuse it; give its IPv4 address, or go on without it"
                                       : "programs refuse it; /etc/hosts has a similar name",
                   .cure = with_peer(facts, peer.host, near)});
  }
}

void judge_own_addresses(const Facts& facts, Findings& out) {
  const auto& peers = facts.network.peers;
  if (peers.empty() || !std::ranges::all_of(peers, [](const Peer& one) { return one.own && is_remote(one.host); }))
    return;
  Request request = facts.request;
  request.network.peers.clear();
  out.push_back({.what = fmt::format("--peers names this host only: {} is an own address", peers.front().host),
                 .why = "no other host is searched for. Give the address of the other host, or run on this host alone",
                 .cure = command_of(request)});
}

/// Whether probes have been sent to a peer.
bool is_probed(const Facts& facts, const Peer& peer) {
  return are_examined(facts) && !peer.address.empty() && !peer.own && peer.route == own_interface(facts)->name;
}

void judge_routes(const Facts& facts, Findings& out) {
  if (!are_examined(facts)) return;
  const Interface& own = *own_interface(facts);
  for (const Peer& peer : facts.network.peers) {
    if (peer.address.empty() || peer.own || peer.route == own.name) continue;
    out.push_back(
        {.what = peer.source.empty() ? fmt::format("there is no route to {}", peer.host)
                                     : fmt::format("the route to {} leaves by {}, not by --interface {}", peer.host,
                                                   peer.route, own.name),
         .why = "messages do not reach the host, or its answers go to another address of this one, without a program",
         .cure = fmt::format("{}ip route replace {}/32 dev {}", as_root(facts), peer.address, own.name)});
  }
}

void judge_presence(const Facts& facts, Findings& out) {
  for (const Peer& peer : facts.network.peers) {
    if (!is_probed(facts, peer) || !peer.neighbour_absent || peer.pings || peer.ports_refuse) continue;
    out.push_back({.what = fmt::format("{} is not there: no host of this network answers for its address", peer.host),
                   .why = "it is switched off, on another network, or has another address",
                   .cure = fmt::format("ip -brief address  # on {}: it must show {} on an interface that is UP",
                                       peer.host, peer.address)});
  }
}

void judge_firewall(const Facts& facts, Findings& out) {
  if (!facts.domain.number) return;
  const int first = first_port(*facts.domain.number);
  for (const Peer& peer : facts.network.peers) {
    if (!is_probed(facts, peer) || peer.neighbour_absent || peer.ports_refuse) continue;
    const int last = first + kPortsOfDomain - 1;
    out.push_back(
        {.what = peer.pings ? fmt::format("{} answers to ping, but not on UDP port {}: something filters it", peer.host,
                                          last - 10)
                            : fmt::format("{} is there, but answers neither to ping nor on UDP", peer.host),
         .why = "a firewall drops the messages, without a reply; an open port that no program uses would say so",
         .cure = fmt::format("ssh {} sudo nft insert rule inet filter input udp dport {}-{} accept", peer.host, first,
                             last)});
  }
}

void judge_path_mtu(const Facts& facts, Findings& out) {
  for (const Peer& peer : facts.network.peers) {
    if (!is_probed(facts, peer) || !peer.pings || peer.pings_full_size) continue;
    const Interface& own = *own_interface(facts);
    const int smaller = own.mtu > 1500 ? 1500 : 1280;
    out.push_back(
        {.what = fmt::format("packets of {} bytes, the MTU of {}, do not reach {}; small ones do", own.mtu, own.name,
                             peer.host),
         .why = "large messages are lost, small ones arrive: programs find each other, and frames do not come",
         .cure = fmt::format("{}ip link set {} mtu {}", as_root(facts), own.name, smaller)});
  }
}

void judge_clocks(const Facts& facts, Findings& out) {
  constexpr double kMost_s = 1.0;
  for (const Peer& peer : facts.network.peers) {
    if (!peer.clock_offset_s || std::abs(*peer.clock_offset_s) <= kMost_s + peer.clock_uncertainty_s) continue;
    out.push_back({.what = fmt::format("the clock of {} is {:.3f} s {} (within {:.3f} s)", peer.host,
                                       std::abs(*peer.clock_offset_s), *peer.clock_offset_s > 0.0 ? "ahead" : "behind",
                                       peer.clock_uncertainty_s),
                   .why = "the run itself does not need the clocks; dates of logs and results do not agree",
                   .cure = fmt::format("{}timedatectl set-ntp true", as_root(facts))});
  }
}

constexpr std::array kPeerChecks{
    Check{"peer_names", "each host of --peers is an IPv4 address or a name that resolves to one", judge_names},
    Check{"peers_are_others", "--peers names a host other than this one", judge_own_addresses},
    Check{"route", "the route to each peer leaves by --interface", judge_routes},
    Check{"peer_present", "each peer on the same network answers for its address (needs root)", judge_presence},
    Check{"firewall",
          "a UDP port of the domain that no program uses refuses a message: nothing filters it (needs root)",
          judge_firewall},
    Check{"path_mtu", "packets as long as the MTU reach each peer (needs root)", judge_path_mtu},
    Check{"clocks", "the clocks of the peers differ by at most 1 s (ICMP time stamps; needs root)", judge_clocks}};

}  // namespace

std::span<const Check> peer_checks() { return kPeerChecks; }

}  // namespace subworld::doctor
