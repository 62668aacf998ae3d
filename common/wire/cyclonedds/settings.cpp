#include "wire/cyclonedds/settings.hpp"

#include "wire/cyclonedds/vendor.hpp"

#include <dlfcn.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string_view>

namespace subworld::wire::cyclone {
namespace {

/// Defaults, which the settings file may override: unicast, messages as long as a datagram, quick repair of losses, no
/// throttling. Without adaptation the initial mark is the one that counts: 30 kB by default, beyond which a reader that
/// was killed blocks its writers until its lease has expired.
constexpr const char* kDefaults = R"(<CycloneDDS><Domain Id="any">
<General><AllowMulticast>false</AllowMulticast><MaxMessageSize>{0}B</MaxMessageSize><FragmentSize>{6}B</FragmentSize></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>{1}</MaxAutoParticipantIndex>
<LeaseDuration>10s</LeaseDuration><SPDPInterval>{2}us</SPDPInterval></Discovery>
<Internal><HeartbeatInterval min="{3}us" minsched="{4}us" max="{2}us">{5}us</HeartbeatInterval>
<GenerateKeyhash>true</GenerateKeyhash><NackDelay>1ms</NackDelay><WriterLingerDuration>100ms</WriterLingerDuration>
<Watermarks><WhcAdaptive>false</WhcAdaptive><WhcHighInit>256MB</WhcHighInit><WhcHigh>256MB</WhcHigh></Watermarks></Internal>
</Domain></CycloneDDS>)";

constexpr int kPacketBytes = 1500 - kPacketHeaderBytes;  // on an interface of the user's settings
constexpr int kFragmentHeaderBytes = 128;                // RTPS, as the vendor's defaults leave

std::string read_file(const std::string& name) {
  std::ifstream file(name);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// `text` without the sections from `begin` to `end`, both included.
void erase_parts(std::string& text, const std::string& begin, const std::string& end) {
  for (std::size_t from = text.find(begin); from != std::string::npos; from = text.find(begin)) {
    const std::size_t to = text.find(end, from);
    if (to == std::string::npos) return;
    text.erase(from, to + end.size() - from);
  }
}

}  // namespace

/// The vendor's plug-ins lie in a folder beside its library.
void use_keys(dds_qos_t* qos, const Keys& keys) {
  Dl_info library{};
  dladdr(reinterpret_cast<const void*>(&dds_create_participant), &library);
  const auto plugins = std::filesystem::path(library.dli_fname).parent_path() / "libddsc0debian";
  const auto set = [&](const std::string& name, const std::string& value) {
    dds_qset_prop(qos, ("dds.sec." + name).c_str(), value.c_str());
  };
  for (const auto& [kind, file, function] : {std::array{"auth", "auth", "authentication"},
                                             {"access", "ac", "access_control"},
                                             {"crypto", "crypto", "crypto"}}) {
    const std::string library_of = std::string(kind) + ".library.";
    set(library_of + "path", plugins / fmt::format("libdds_security_{}.so", file));
    set(library_of + "init", fmt::format("init_{}", function));
    set(library_of + "finalize", fmt::format("finalize_{}", function));
  }
  set("auth.identity_ca", "file:" + keys.authority);
  set("auth.identity_certificate", "file:" + keys.certificate);
  set("auth.private_key", "file:" + keys.private_key);
  set("access.permissions_ca", "file:" + keys.authority);
  set("access.governance", "file:" + keys.governance);
  set("access.permissions", "file:" + keys.permissions);
}

/// Later sections of the list override earlier ones, but lists of interfaces and peers are merged. Therefore each
/// appears once.
std::string make_settings(const Opening& opening, std::string& route_text) {
  std::string user = opening.settings_file;
  if (!user.empty() && user.find('<') == std::string::npos && user.find(',') == std::string::npos) {
    constexpr std::string_view kScheme = "file://";
    user = read_file(user.starts_with(kScheme) ? user.substr(kScheme.size()) : user);
    if (user.empty()) fail(fmt::format("{}: empty or not readable", opening.settings_file));
  }
  erase_parts(user, "<?", "?>");
  erase_parts(user, "<!--", "-->");
  if (!opening.interface_address.empty()) erase_parts(user, "<Interfaces", "</Interfaces>");
  if (!opening.peers.empty()) erase_parts(user, "<Peers", "</Peers>");
  const Route route(opening, user.find("<NetworkInterface") != std::string::npos,
                    user.find("<Peer ") != std::string::npos);
  std::string network;
  if (!route.address.empty()) {
    network =
        fmt::format("<General><Interfaces><NetworkInterface address=\"{}\"/></Interfaces></General>", route.address);
  }
  if (route.peers && !route.peers->empty()) {
    network += "<Discovery><Peers>";
    for (const std::string& peer : *route.peers) network += fmt::format("<Peer Address=\"{}\"/>", peer);
    network += "</Peers></Discovery>";
  }
  route_text = route.text();
  const int message_bytes = route.address.empty() ? kPacketBytes : opening.message_bytes;
  const auto thinned_us = [&](double period_s) { return std::lround(1e6 * period_s * opening.thinning); };
  const std::string defaults = fmt::format(fmt::runtime(kDefaults), message_bytes, opening.participants - 1,
                                           thinned_us(1.0), thinned_us(0.05 * kRepeat_s), thinned_us(0.25 * kRepeat_s),
                                           thinned_us(kRepeat_s), message_bytes - kFragmentHeaderBytes);
  return fmt::format("{},{}{}<CycloneDDS><Domain Id=\"any\">{}</Domain></CycloneDDS>", defaults, user,
                     user.empty() ? "" : ",", network);
}

}  // namespace subworld::wire::cyclone
