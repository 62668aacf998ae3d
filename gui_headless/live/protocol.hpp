#pragma once

#include "sources.hpp"

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

/// Messages of the Foxglove WebSocket protocol: JSON texts, and binary messages with samples.
namespace subworld::live {

/// In the order in which the server prefers them.
inline constexpr std::array<std::string_view, 2> kProtocols{"foxglove.sdk.v1", "foxglove.websocket.v1"};

enum class Level : std::uint8_t { info, warning, error };

/// `connection`: the client's number.
[[nodiscard]] std::string server_info_text(const std::string& name, const std::string& session,
                                           std::uint32_t connection);
[[nodiscard]] std::string advertise_text(const std::vector<Channel>& channels);
/// A status with an `id` replaces the earlier one of that id.
[[nodiscard]] std::string status_text(Level level, const std::string& message, const std::string& id = {});
/// What precedes the bytes of a sample.
[[nodiscard]] std::array<std::uint8_t, 13> data_header(std::uint32_t subscription, std::uint64_t time_ns) noexcept;

struct Subscription {
  std::uint32_t id = 0;
  std::uint32_t channel = 0;
};
struct Subscribe {
  std::vector<Subscription> subscriptions;
};
struct Unsubscribe {
  std::vector<std::uint32_t> subscriptions;
};
/// A client will publish on this topic, under an id of its own.
struct Publication {
  std::uint32_t id = 0;
  std::string topic;
  std::string encoding;
};
struct Advertise {
  std::vector<Publication> publications;
};
struct Unadvertise {
  std::vector<std::uint32_t> publications;
};
/// A message on a channel that the client has advertised. The bytes live as long as those of the client's message.
struct Publish {
  std::uint32_t publication = 0;
  std::span<const std::uint8_t> bytes;
};
/// A message without effect, and the reason.
struct Refused {
  std::string why;
};
using Request = std::variant<Subscribe, Unsubscribe, Advertise, Unadvertise, Publish, Refused>;
/// Reads a text message of a client.
[[nodiscard]] Request parse_request(std::string_view text);
/// Reads a binary message of a client.
[[nodiscard]] Request parse_binary(std::span<const std::uint8_t> message);

}  // namespace subworld::live
