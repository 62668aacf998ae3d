#pragma once

#include "link/forwarder.hpp"
#include "link/host.hpp"
#include "link/settings.hpp"

#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

namespace subworld {

/// What carries the packets of an emulated network.
enum class LinkBackend : std::uint8_t {
  automatic,  ///< netem where the kernel has it and it can do what the links ask for, else the TUN forwarder
  netem,      ///< two hosts with a virtual cable, and `tc netem` at both ends
  tun,        ///< a TUN device in each host, and the `Forwarder`
};

struct EmulatedNetworkSettings {
  LinkBackend backend = LinkBackend::automatic;
  int mtu = 1500;          ///< bytes, 576 .. 9000
  std::uint64_t seed = 1;  ///< of all random draws; netem has its own
  std::string subnet = "10.9.0";
};

/// Carries the packets of all links.
class LinkCarrier {
 public:
  virtual ~LinkCarrier() = default;
  virtual void set(LinkEnds ends, const LinkSettings& settings) = 0;
  [[nodiscard]] virtual LinkCounters counters(LinkEnds ends) = 0;
  /// CPU time that it has used, s; 0 where the kernel does the work.
  [[nodiscard]] virtual double cpu_s() = 0;
  /// "netem", or "tun" with its scheduling.
  [[nodiscard]] virtual std::string description() const = 0;
};

/// Hosts on one machine, each a network namespace with one interface `eth0`, and a link for each ordered pair of them.
///   EmulatedNetwork network;
///   const int a = network.add_host("a"), b = network.add_host("b");
///   network.set_links(parse_link("wifi"));
///   network.start();
///   const pid_t child = network.host(a).start("ping -c 3 " + network.address(b));
/// Everything is removed with the object. Not for use from several threads at once.
class EmulatedNetwork {
 public:
  static constexpr const char* kInterface = "eth0";
  static constexpr int kMostHosts = 254;

  explicit EmulatedNetwork(EmulatedNetworkSettings settings = {});
  ~EmulatedNetwork();
  EmulatedNetwork(const EmulatedNetwork&) = delete;
  EmulatedNetwork& operator=(const EmulatedNetwork&) = delete;

  /// Before the start. Returns the number of the host, from 0. Throws `Error`: see `NetworkHost`.
  int add_host(const std::string& name);
  /// Before the start, or while it runs: then from the next packet on. Throws `Error` (failed).
  void set_link(LinkEnds ends, const LinkSettings& settings);
  /// All links.
  void set_links(const LinkSettings& settings);
  /// Connects the hosts. Throws `Error` (failed), with the cure.
  void start();

  [[nodiscard]] int hosts() const { return static_cast<int>(hosts_.size()); }
  [[nodiscard]] const NetworkHost& host(int number) const { return hosts_[number]; }
  /// IPv4: the subnet with the number of the host, counted from 1.
  [[nodiscard]] std::string address(int host) const;
  [[nodiscard]] LinkSettings link(LinkEnds ends) const { return links_.at(index(ends)); }
  [[nodiscard]] LinkCounters counters(LinkEnds ends) { return carrier_->counters(ends); }
  [[nodiscard]] double cpu_s() { return carrier_->cpu_s(); }
  [[nodiscard]] std::string description() const { return carrier_->description(); }

 private:
  [[nodiscard]] std::size_t index(LinkEnds ends) const { return ends.from * hosts_.size() + ends.to; }
  EmulatedNetworkSettings settings_;
  LinkSettings default_;
  std::deque<NetworkHost> hosts_;
  std::vector<std::pair<LinkEnds, LinkSettings>> chosen_;  ///< before the start
  std::vector<LinkSettings> links_;
  std::unique_ptr<LinkCarrier> carrier_;
};

/// The options of `tc qdisc ... netem` for these settings. Throws `Error` (usage) for what netem does not have.
[[nodiscard]] std::vector<std::string> netem_words(const LinkSettings& settings);

/// Connects two hosts with a virtual cable and netem. Throws `Error` (failed) where the kernel has no netem.
[[nodiscard]] std::unique_ptr<LinkCarrier> netem_carrier(const NetworkHost& a, const NetworkHost& b,
                                                         const std::vector<std::string>& addresses,
                                                         const std::vector<LinkSettings>& links, int mtu);

}  // namespace subworld
