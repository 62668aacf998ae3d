#include "link/network.hpp"

#include "model/error.hpp"

#include <arpa/inet.h>
#include <fmt/core.h>
#include <unistd.h>

namespace subworld {

EmulatedNetwork::~EmulatedNetwork() {
  forwarder_.reset();
  for (const int tun : tuns_) close(tun);
}

int EmulatedNetwork::add_host(const std::string& name) {
  if (hosts() == kMostHosts)
    throw Error(ExitCode::usage, fmt::format("link: at most {} hosts have an address in one subnet", kMostHosts));
  hosts_.emplace_back(name);
  return hosts() - 1;
}

std::string EmulatedNetwork::address(int host) const { return fmt::format("10.9.0.{}", host + 1); }

LinkSettings EmulatedNetwork::link(LinkEnds ends) const {
  const auto chosen = chosen_.find({ends.from, ends.to});
  return chosen == chosen_.end() ? default_ : chosen->second;
}

void EmulatedNetwork::set_link(LinkEnds ends, const LinkSettings& settings) {
  chosen_[{ends.from, ends.to}] = settings;
  if (forwarder_) forwarder_->set(ends, settings);
}

void EmulatedNetwork::set_links(const LinkSettings& settings) {
  default_ = settings;
  chosen_.clear();
  for (int link = 0; forwarder_ && link < hosts() * hosts(); ++link)
    forwarder_->set({link / hosts(), link % hosts()}, settings);
}

void EmulatedNetwork::start() {
  constexpr int kMtu = 1500;
  std::vector<Forwarder::Host> ends;
  std::vector<LinkSettings> links;
  for (int i = 0; i < hosts(); ++i) {
    hosts_[i].inside([&] { tuns_.push_back(open_tun(kInterface, address(i), kMtu)); });
    in_addr ip{};
    inet_pton(AF_INET, address(i).c_str(), &ip);
    ends.push_back({tuns_.back(), ntohl(ip.s_addr)});
    for (int to = 0; to < hosts(); ++to) links.push_back(link({i, to}));
  }
  forwarder_ = std::make_unique<Forwarder>(ends, links, kMtu, seed_);
}

}  // namespace subworld
