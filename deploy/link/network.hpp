#pragma once

#include "link/forwarder.hpp"
#include "link/host.hpp"
#include "link/settings.hpp"

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace subworld {

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

  /// `seed` is that of all random draws.
  explicit EmulatedNetwork(std::uint64_t seed = 1) : seed_(seed) {}
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
  /// IPv4: 10.9.0.1 for the first host.
  [[nodiscard]] std::string address(int host) const;
  [[nodiscard]] LinkSettings link(LinkEnds ends) const;
  /// What the thread that forwards the packets has counted and used, and its scheduling. After the start.
  [[nodiscard]] LinkCounters counters(LinkEnds ends) { return forwarder_->counters(ends); }
  [[nodiscard]] double cpu_s() { return forwarder_->cpu_s(); }
  [[nodiscard]] std::string scheduling() const { return forwarder_->scheduling(); }

 private:
  std::uint64_t seed_;
  std::deque<NetworkHost> hosts_;
  LinkSettings default_;
  std::map<std::pair<int, int>, LinkSettings> chosen_;  ///< from, to
  std::vector<int> tuns_;
  std::unique_ptr<Forwarder> forwarder_;
};

}  // namespace subworld
