#include "io/options/live_options.hpp"

#include "model/error.hpp"

#include <arpa/inet.h>
#include <fmt/core.h>

#include <array>
#include <string_view>

namespace subworld {
namespace {

std::string address_fault(const std::string& text) {
  std::array<unsigned char, 16> address{};
  if (inet_pton(AF_INET, text.c_str(), address.data()) == 1 || inet_pton(AF_INET6, text.c_str(), address.data()) == 1)
    return {};
  return "an IP address of this machine is needed, as 192.168.1.5, or 0.0.0.0 for all of them";
}

/// A token stands in addresses and headers as it is.
std::string token_fault(const std::string& token) {
  constexpr std::string_view kKnown = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-._~";
  constexpr std::size_t kLeast = 12;
  if (token.size() >= kLeast && token.find_first_not_of(kKnown) == std::string::npos) return {};
  return fmt::format("a token has at least {} characters: letters, digits, and -._~", kLeast);
}

/// As a browser names a site.
std::string origin_fault(const std::string& origin) {
  const std::size_t host = origin.find("://");
  if (host != std::string::npos && origin.find_first_of("/ *", host + 3) == std::string::npos) return {};
  return "the origin of a web site is needed, as https://example.org or http://localhost:8081, without a path";
}

bool is_loopback(const std::string& address) { return address.starts_with("127.") || address == "::1"; }

}  // namespace

void add_live_options(CommandLine& line, LiveOptions& live, const std::string& what) {
  const Option port = line.add("--live", &live.port, what).range(0, 65535).otherwise("viewers are not served");
  line.add("--listen", &live.address, "with --live: own IP address to listen on; any but loopback needs a token")
      .check(address_fault)
      .needs(port);
  line.add("--token", &live.token, "with --live: a text of at least 12 characters that viewers must give")
      .check(token_fault)
      .environment(kTokenVariable);
  line.add("--origin", &live.origins, "with --live: origins of other web sites whose pages may read the run")
      .check(origin_fault)
      .otherwise("those of Lichtblick and Foxglove");
}

void check_live_options(const LiveOptions& live) {
  if (!live.port || !live.token.empty() || is_loopback(live.address)) return;
  throw Error(ExitCode::usage, fmt::format("--listen {}: other machines reach this address, so viewers need a token; "
                                           "set it by {} or --token",
                                           live.address, kTokenVariable));
}

std::vector<std::string> live_flags_of(const LiveOptions& live) {
  if (!live.port) return {};
  std::vector<std::string> words{"--live", std::to_string(*live.port), "--listen", live.address};
  for (const std::string& origin : live.origins) words.insert(words.end(), {"--origin", origin});
  return words;
}

}  // namespace subworld
