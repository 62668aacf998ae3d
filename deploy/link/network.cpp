#include "link/network.hpp"

#include "model/error.hpp"

#include <arpa/inet.h>
#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>

namespace subworld {

namespace {

/// TUN devices of the hosts and their forwarder.
class TunCarrier : public LinkCarrier {
 public:
  TunCarrier(const std::deque<NetworkHost>& hosts, const std::vector<std::string>& addresses,
             const std::vector<LinkSettings>& links, const EmulatedNetworkSettings& settings) {
    std::vector<Forwarder::Host> ends;
    for (std::size_t i = 0; i < hosts.size(); ++i) {
      hosts[i].inside([&] { tuns_.push_back(open_tun(EmulatedNetwork::kInterface, addresses[i], settings.mtu)); });
      in_addr address{};
      inet_pton(AF_INET, addresses[i].c_str(), &address);
      ends.push_back({tuns_.back(), ntohl(address.s_addr)});
    }
    forwarder_ = std::make_unique<Forwarder>(ends, links, settings.mtu, settings.seed);
  }
  ~TunCarrier() override {
    forwarder_.reset();
    for (const int tun : tuns_) close(tun);
  }
  TunCarrier(const TunCarrier&) = delete;
  TunCarrier& operator=(const TunCarrier&) = delete;

  void set(LinkEnds ends, const LinkSettings& settings) override { forwarder_->set(ends, settings); }
  LinkCounters counters(LinkEnds ends) override { return forwarder_->counters(ends); }
  double cpu_s() override { return forwarder_->cpu_s(); }
  std::string description() const override { return fmt::format("tun ({})", forwarder_->scheduling()); }

 private:
  std::vector<int> tuns_;
  std::unique_ptr<Forwarder> forwarder_;
};

}  // namespace

EmulatedNetwork::EmulatedNetwork(EmulatedNetworkSettings settings) : settings_(std::move(settings)) {}

EmulatedNetwork::~EmulatedNetwork() = default;

int EmulatedNetwork::add_host(const std::string& name) {
  if (hosts() == kMostHosts)
    throw Error(ExitCode::usage, fmt::format("link: at most {} hosts have an address in one subnet", kMostHosts));
  hosts_.emplace_back(name);
  return hosts() - 1;
}

std::string EmulatedNetwork::address(int host) const { return fmt::format("{}.{}", settings_.subnet, host + 1); }

void EmulatedNetwork::set_link(LinkEnds ends, const LinkSettings& settings) {
  if (!carrier_) return void(chosen_.emplace_back(ends, settings));
  carrier_->set(ends, settings);
  links_[index(ends)] = settings;
}

void EmulatedNetwork::set_links(const LinkSettings& settings) {
  default_ = settings;
  chosen_.clear();
  if (!carrier_) return;
  for (int from = 0; from < hosts(); ++from) {
    for (int to = 0; to < hosts(); ++to) {
      if (from != to) set_link({from, to}, settings);
    }
  }
}

void EmulatedNetwork::start() {
  links_.assign(hosts_.size() * hosts_.size(), default_);
  for (const auto& [ends, settings] : chosen_) links_[index(ends)] = settings;
  std::vector<std::string> addresses;
  for (int i = 0; i < hosts(); ++i) addresses.push_back(address(i));
  const bool has_outage = std::ranges::any_of(links_, [](const LinkSettings& link) { return link.outage.for_s > 0.0; });
  const bool asked = settings_.backend == LinkBackend::netem;
  if (asked && hosts() != 2)
    throw Error(ExitCode::usage, fmt::format("link: netem connects two hosts, not {}; use --backend tun", hosts()));
  if (asked || (settings_.backend == LinkBackend::automatic && hosts() == 2 && !has_outage)) {
    try {
      carrier_ = netem_carrier(hosts_[0], hosts_[1], addresses, links_, settings_.mtu);
      return;
    } catch (const Error&) {
      if (asked) throw;
    }
  }
  carrier_ = std::make_unique<TunCarrier>(hosts_, addresses, links_, settings_);
}

}  // namespace subworld
