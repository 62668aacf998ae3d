#pragma once

#include "sources.hpp"

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
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

/// A request of a client.
struct Request {
  enum class Op : std::uint8_t { subscribe, unsubscribe, advertise, unadvertise, publish, refused };
  struct Item {
    std::uint32_t id = 0;         ///< of a subscription, or of a channel on which the client publishes: its own number
    std::uint32_t channel = 0;    ///< to which it subscribes
    std::string topic, encoding;  ///< of what it will publish
  };
  Op op = Op::refused;
  std::vector<Item> items;
  std::span<const std::uint8_t> bytes;  ///< that are published; they live as long as those of the message
  std::string why;                      ///< a message is refused
};
/// Reads a text message of a client.
[[nodiscard]] Request parse_request(std::string_view text);
/// Reads a binary message of a client.
[[nodiscard]] Request parse_binary(std::span<const std::uint8_t> message);

}  // namespace subworld::live
