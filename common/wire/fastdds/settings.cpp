#include "wire/fastdds/settings.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <memory>
#include <set>
#include <vector>

namespace subworld::wire::fast {
namespace {

constexpr const char* kProfile = "subworld";
// Fast DDS 2.9 may abort where a lease is checked while its participant leaves: run ends must not coincide with checks.
// The programs notice a death by the missing status.
constexpr double kLease_s = 100.0;

/// Loads the user's settings.
void load_settings(dds::DomainParticipantFactory& factory, const Opening& opening, dds::DomainParticipantQos& qos) {
  if (opening.settings_file.empty()) return;
  const std::string& file = opening.settings_file;
  const SettingsFile settings(factory, file);
  if (!settings.valid()) {
    fail(fmt::format("{}: not a valid profile file; compare it with deploy/qos/fastdds.xml", file));
  }
  if (opening.settings_from_environment) {
    settings.read_default(qos);
  } else if (!settings.read(kProfile, qos)) {
    fail(fmt::format("{}: has no participant profile \"{}\"; compare it with deploy/qos/fastdds.xml", file, kProfile));
  }
}

/// Sends shorter messages than it can receive.
struct Transport : UDPv4TransportDescriptor {
  std::uint32_t sent_bytes = kMessageBytes;
  [[nodiscard]] std::uint32_t max_message_size() const override { return sent_bytes; }
};

void use_interface(dds::DomainParticipantQos& qos, const std::string& address, const Opening& opening) {
  auto udp = std::make_shared<Transport>();
  udp->maxMessageSize = kMessageBytes;
  for (const auto& one : qos.transport().user_transports) {
    if (const auto* users = dynamic_cast<const UDPv4TransportDescriptor*>(one.get()))
      static_cast<UDPv4TransportDescriptor&>(*udp) = *users;
  }
  udp->sent_bytes = std::min(udp->maxMessageSize, static_cast<std::uint32_t>(opening.message_bytes));
  udp->interfaceWhiteList = {address};
  udp->maxInitialPeersRange = std::max(udp->maxInitialPeersRange, static_cast<std::uint32_t>(opening.participants));
  if (udp->sendBufferSize == 0) udp->sendBufferSize = 1U << 20U;
  if (udp->receiveBufferSize == 0) udp->receiveBufferSize = 4U << 20U;
  qos.transport().user_transports = {udp};
  qos.transport().use_builtin_transports = false;  // no shared memory: no files in /dev/shm

  rtps::Locator_t here;
  rtps::IPLocator::setIPv4(here, address);
  // Explicit unicast locators suppress the multicast ones; port 0 means the well-known port.
  qos.wire_protocol().builtin.metatrafficUnicastLocatorList.clear();
  qos.wire_protocol().builtin.metatrafficUnicastLocatorList.push_back(here);
  qos.wire_protocol().default_unicast_locator_list.clear();
  qos.wire_protocol().default_unicast_locator_list.push_back(here);
}

void use_peers(dds::DomainParticipantQos& qos, const std::vector<std::string>& peers) {
  auto& list = qos.wire_protocol().builtin.initialPeersList;
  list.clear();
  for (const std::string& peer : peers) {
    rtps::Locator_t there;
    rtps::IPLocator::setIPv4(there, peer);
    list.push_back(there);
  }
}

void use_keys(dds::DomainParticipantQos& qos, const Keys& keys) {
  const std::string identity = "builtin.PKI-DH", access = "builtin.Access-Permissions";
  const auto set = [&](const std::string& name, const std::string& value) {
    qos.properties().properties().emplace_back("dds.sec." + name, value);
  };
  set("auth.plugin", identity);
  set("auth." + identity + ".identity_ca", "file://" + keys.authority);
  set("auth." + identity + ".identity_certificate", "file://" + keys.certificate);
  set("auth." + identity + ".private_key", "file://" + keys.private_key);
  set("access.plugin", access);
  set("access." + access + ".permissions_ca", "file://" + keys.authority);
  set("access." + access + ".governance", "file://" + keys.governance);
  set("access." + access + ".permissions", "file://" + keys.permissions);
  set("crypto.plugin", "builtin.AES-GCM-GMAC");
}

/// True if the UDP port is free.
bool port_is_free(const std::string& interface_address, int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  inet_pton(AF_INET, interface_address.c_str(), &address.sin_addr);
  const int handle = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const bool free = bind(handle, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  close(handle);
  return free;
}

/// The library numbers the participants of a process in ascending order, until their ports are outside the range that
/// peers try. This function returns the lowest number whose ports are free and that no participant of this process has,
/// also in another domain: the library refuses it. If another process takes it first, the library itself moves on.
int free_participant_index(const std::string& interface_address, int domain, int participants,
                           const std::set<int>& own_numbers) {
  const rtps::PortParameters ports;
  const int first = ports.portBase + ports.domainIDGain * domain;
  for (int index = 0; index < participants; ++index) {
    const int own = first + ports.participantIDGain * index;
    if (!own_numbers.contains(index) && port_is_free(interface_address, own + ports.offsetd1) &&
        port_is_free(interface_address, own + ports.offsetd3)) {
      return index;
    }
  }
  fail(fmt::format(
      "domain {}: the ports of all {} participants on {} are in use; choose another --domain or stop programs "
      "that still run",
      domain, participants, interface_address));
}

}  // namespace

dds::DomainParticipantQos participant_qos(dds::DomainParticipantFactory& factory, const Opening& opening,
                                          std::string& route_text, const std::set<int>& own_numbers) {
  dds::DomainParticipantQos qos;
  load_settings(factory, opening, qos);
  auto& discovery = qos.wire_protocol().builtin.discovery_config;
  if (discovery == rtps::DiscoverySettings{}) {
    discovery.leaseDuration = duration(kLease_s);
    discovery.leaseDuration_announcementperiod = duration(opening.thinning);
    discovery.initial_announcements.count = 10;
    discovery.initial_announcements.period = duration(0.05);
  }

  const Route route(opening, !qos.transport().user_transports.empty(),
                    !qos.wire_protocol().builtin.initialPeersList.empty());
  if (!route.address.empty()) {
    use_interface(qos, route.address, opening);
    qos.wire_protocol().participant_id =
        free_participant_index(route.address, opening.domain, opening.participants, own_numbers);
  }
  if (route.peers) use_peers(qos, *route.peers);
  if (opening.keys) use_keys(qos, *opening.keys);
  route_text = route.text();
  qos.name(opening.participant_name.c_str());
  return qos;
}

}  // namespace subworld::wire::fast
