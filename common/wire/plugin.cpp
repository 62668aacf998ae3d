#include "wire/plugin.hpp"

#include "model/joined.hpp"
#include "model/places.hpp"
#include "model/settings/network.hpp"

#include <arpa/inet.h>
#include <dlfcn.h>
#include <fmt/core.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>

namespace subworld::wire {
namespace {

constexpr int kLastDomain = 232;  // higher domains have no valid ports

struct VendorFacts {
  Vendor vendor;
  const char* name;
  const char* package;
};

constexpr std::array kVendors{
    VendorFacts{Vendor::fastdds, "fastdds", FASTDDS_PACKAGE},
    VendorFacts{Vendor::cyclonedds, "cyclonedds", CYCLONEDDS_PACKAGE},
};

const VendorFacts& facts(Vendor vendor) { return kVendors[static_cast<std::size_t>(vendor)]; }

const char* settings_variable(Vendor vendor) {
  return std::ranges::find(kVendorVariables, vendor, &VendorVariable::settings_of)->name;
}

[[noreturn]] void fail(const std::string& message) { throw Error(ExitCode::middleware, message); }

std::string to_text(const in_addr& address) {
  std::array<char, INET_ADDRSTRLEN> text{};
  inet_ntop(AF_INET, &address, text.data(), text.size());
  return text.data();
}

/// Empty, with the reason in `error`, where there is no address.
std::string try_resolve(const std::string& host, std::string& error) {
  addrinfo hints{};
  hints.ai_family = AF_INET;
  hints.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  if (const int code = getaddrinfo(host.c_str(), nullptr, &hints, &found); code != 0) {
    error = gai_strerror(code);
    return {};
  }
  sockaddr_in address{};
  std::memcpy(&address, found->ai_addr, sizeof address);
  freeaddrinfo(found);
  return to_text(address.sin_addr);
}

struct Interface {
  std::string address;  ///< IPv4; empty: there is none
  bool running = false;
  bool loopback = false;
  int mtu = 1500;
};

/// Of this network namespace: /sys may show another one.
int mtu_of(const char* name) {
  ifreq request{};
  std::strncpy(request.ifr_name, name, IFNAMSIZ - 1);
  const int handle = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const bool known = ioctl(handle, SIOCGIFMTU, &request) == 0;
  close(handle);
  return known ? request.ifr_mtu : Interface{}.mtu;
}

constexpr const char* kLoopback = "127.0.0.1";

/// The interface that has this name or IPv4 address.
Interface find_interface(const std::string& wanted) {
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0) fail(fmt::format("network interfaces: {}", std::strerror(errno)));
  Interface found;
  for (const ifaddrs* one = all; one != nullptr && found.address.empty(); one = one->ifa_next) {
    if (one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET) continue;
    sockaddr_in address{};
    std::memcpy(&address, one->ifa_addr, sizeof address);
    const std::string text = to_text(address.sin_addr);
    if (wanted == text || wanted == one->ifa_name)
      found = {text, (one->ifa_flags & IFF_RUNNING) != 0, (one->ifa_flags & IFF_LOOPBACK) != 0, mtu_of(one->ifa_name)};
  }
  freeifaddrs(all);
  return found;
}

/// Both vendors need the address of an interface. Fast DDS would start without one and reach no peer.
Interface usable_interface(const std::string& wanted) {
  Interface found = find_interface(wanted);
  std::string ignored;
  if (found.address.empty()) found = find_interface(try_resolve(wanted, ignored));
  if (found.address.empty()) {
    fail(
        fmt::format("--interface {}: no network interface has it; use a name or an IPv4 address that `ip -brief "
                    "address` lists",
                    wanted));
  }
  if (!found.running) fail(fmt::format("--interface {}: is not running; see `ip -brief link`", wanted));
  return found;
}

/// A program on loopback reaches no other host. Where the user names a settings file, that may choose the interface.
void check_reach(const std::vector<std::string>& peers, const Interface& interface, bool users_settings) {
  if (interface.address.empty() && !users_settings && !find_interface(kLoopback).running)
    fail("loopback, the default interface, is down; `ip link set lo up`, or name another --interface");
  const auto remote = std::find_if(peers.begin(), peers.end(), is_remote);
  if (remote == peers.end()) return;
  const bool unnamed = interface.address.empty() && !users_settings;
  if (!unnamed && !interface.loopback) return;
  fail(
      fmt::format("--peers {}{}, reaches this host only; name the network interface that leads there, see `ip -brief "
                  "address`",
                  *remote, unnamed ? " needs --interface: the default, loopback" : ": the --interface, loopback"));
}

}  // namespace

std::vector<std::string> ignore_variables() {
  std::vector<std::string> ignored;
  for (const VendorVariable& one : kVendorVariables) {
    const char* value = one.settings_of ? nullptr : std::getenv(one.name);
    if (value == nullptr) continue;
    if (*value != '\0') ignored.emplace_back(one.name);
    unsetenv(one.name);
  }
  setenv("SKIP_DEFAULT_XML_FILE", "1", 1);  // Fast DDS: no file of the working folder
  return ignored;
}

Keys keys_of(const std::string& folder, std::string_view program) {
  if (folder.find_first_of("\"\\") != std::string::npos)
    fail(fmt::format("--secure {}: Cyclone DDS opens no path with \" or \\; rename the folder", folder));
  std::string role(program.starts_with("subworld") ? "subworld" : program);
  std::ranges::replace(role, ' ', '_');
  const std::filesystem::path all = std::filesystem::absolute(folder), own = all / role;
  const Keys keys{all / "authority.pem", all / "governance.p7s", own / "certificate.pem", own / "key.pem",
                  own / "permissions.p7s"};
  for (const std::string& file :
       {keys.authority, keys.governance, keys.certificate, keys.private_key, keys.permissions}) {
    if (access(file.c_str(), R_OK) == 0) continue;
    fail(fmt::format(
        "--secure {}: {}: {}; make keys for all users with `subworld keys make NEW --users N`, or copy those of this "
        "role to this host",
        folder, file, std::strerror(errno)));
  }
  return keys;
}

Opening prepare(const BusConfig& config) {
  if (config.domain < 0 || config.domain > kLastDomain) {
    fail(fmt::format("DDS domain {}: use 0 .. {}", config.domain, kLastDomain));
  }
  Opening opening;
  opening.domain = config.domain;
  opening.participants = config.participants;
  opening.thinning = thinning(config.users);
  opening.participant_name = config.participant_name;
  const VendorFacts& vendor = facts(config.vendor);
  const char* variable = settings_variable(config.vendor);
  const char* value = std::getenv(variable);
  const std::string environment = value != nullptr ? value : "";
  const bool users_settings = !config.qos_file.empty() || !environment.empty();
  Interface interface;
  if (!config.interface_address.empty()) interface = usable_interface(config.interface_address);
  check_reach(config.peers, interface, users_settings);
  opening.interface_address = interface.address;
  if (!interface.address.empty()) opening.message_bytes = std::min(interface.mtu - kPacketHeaderBytes, kMessageBytes);
  for (const std::string& peer : config.peers) {
    std::string error;
    opening.peers.push_back(try_resolve(peer, error));
    if (!error.empty())
      fail(
          fmt::format("--peers: host {}: {}; give IPv4 addresses or names that this machine can resolve", peer, error));
  }

  constexpr int kLastSecured = 230;  // for both vendors
  if (!config.secure.empty() && config.domain > kLastSecured)
    fail(fmt::format("--secure: keys hold for the domains 0 to {}; choose another --domain", kLastSecured));
  if (!config.secure.empty()) opening.keys = keys_of(config.secure, config.participant_name);
  // A file of the machine's administrator outlives an upgrade of the package.
  const std::string file = std::string(vendor.name) + ".xml", own = "/etc/subworld/" + file;
  const auto beside = program_folder() / "qos" / file;
  if (!config.qos_file.empty()) {
    if (access(config.qos_file.c_str(), R_OK) != 0) {
      fail(fmt::format("QoS file {}: {}; give a readable XML file of {}", config.qos_file, std::strerror(errno),
                       vendor.name));
    }
    opening.settings_file = config.qos_file;
  } else if (!environment.empty()) {
    opening.settings_from_environment = true;
    opening.settings_file = environment;
  } else if (access(own.c_str(), R_OK) == 0) {
    opening.settings_file = own;
  } else if (access(beside.c_str(), R_OK) == 0) {
    opening.settings_file = beside.string();
  }
  opening.settings_source = opening.settings_from_environment ? fmt::format("{}={}", variable, environment)
                            : opening.settings_file.empty()   ? "built-in"
                                                              : opening.settings_file;
  if (const auto ignored = ignore_variables(); !ignored.empty())
    opening.settings_source += " ignored=" + joined(ignored, ",");
  return opening;
}

namespace {

std::string plugin_file(Vendor vendor) {
  const char* given = std::getenv("SUBWORLD_PLUGIN_DIR");
  const std::filesystem::path folder = given != nullptr && *given != '\0' ? given : program_folder();
  return (folder / fmt::format("libsubworld_{}.so", facts(vendor).name)).string();
}

/// Never unloaded: the vendor's threads and static objects live as long as the process.
void* load(const std::string& file) {
  (void)ignore_variables();
  return dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
}

}  // namespace

std::string installed_version(Vendor vendor) {
  void* const handle = load(plugin_file(vendor));
  const auto version =
      reinterpret_cast<BackendVersion>(handle == nullptr ? nullptr : dlsym(handle, kBackendVersionName));
  return version == nullptr ? "" : version();
}

OpenBackend load_plugin(Vendor vendor) {
  const VendorFacts& wanted = facts(vendor);
  const std::string file = plugin_file(vendor);
  if (access(file.c_str(), R_OK) != 0) {
    fail(
        fmt::format("{}: not found; it is installed beside the programs, and built only where the development package "
                    "of {} was; or set SUBWORLD_PLUGIN_DIR to the folder that has it",
                    file, wanted.name));
  }
  void* handle = load(file);
  if (handle == nullptr) {
    fail(fmt::format("{}: {}; install the Debian package {}, or choose the other vendor", file, dlerror(),
                     wanted.package));
  }
  void* entry = dlsym(handle, kOpenBackendName);
  if (entry == nullptr)
    fail(fmt::format("{}: has no {}; it is of another version, install both again", file, kOpenBackendName));
  return reinterpret_cast<OpenBackend>(entry);
}

}  // namespace subworld::wire

namespace subworld {

Vendor parse_vendor(std::string_view name) {
  for (const auto& vendor : wire::kVendors) {
    if (name == vendor.name) return vendor.vendor;
  }
  throw Error(ExitCode::usage, fmt::format("DDS vendor {}: use fastdds or cyclonedds", name));
}

const char* name_of(Vendor vendor) noexcept { return wire::facts(vendor).name; }

}  // namespace subworld
