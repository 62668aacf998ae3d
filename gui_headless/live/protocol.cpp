#include "protocol.hpp"

#include "io/version.hpp"

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include <limits>
#include <optional>

namespace subworld::live {
namespace {

using nlohmann::json;

std::string text_of(const json& message) { return message.dump(-1, ' ', false, json::error_handler_t::replace); }

std::optional<std::uint32_t> id_of(const json& value) {
  if (!value.is_number_unsigned()) return std::nullopt;
  const auto number = value.get<std::uint64_t>();
  if (number > std::numeric_limits<std::uint32_t>::max()) return std::nullopt;
  return static_cast<std::uint32_t>(number);
}

Request read_subscribe(const json& message) {
  Subscribe request;
  const auto list = message.find("subscriptions");
  if (list == message.end() || !list->is_array()) return Refused{"subscribe: \"subscriptions\" is no list"};
  for (const json& one : *list) {
    const auto id = one.is_object() && one.contains("id") ? id_of(one["id"]) : std::nullopt;
    const auto channel = one.is_object() && one.contains("channelId") ? id_of(one["channelId"]) : std::nullopt;
    if (!id || !channel) return Refused{"subscribe: each subscription needs \"id\" and \"channelId\", 0 to 4294967295"};
    request.subscriptions.push_back({*id, *channel});
  }
  return request;
}

/// A list of ids, or why it is none.
std::variant<std::vector<std::uint32_t>, Refused> read_ids(const json& message, const char* op, const char* key) {
  std::vector<std::uint32_t> ids;
  const auto list = message.find(key);
  if (list == message.end() || !list->is_array()) return Refused{fmt::format("{}: \"{}\" is no list", op, key)};
  for (const json& one : *list) {
    const auto id = id_of(one);
    if (!id) return Refused{fmt::format("{}: an id is a number from 0 to 4294967295", op)};
    ids.push_back(*id);
  }
  return ids;
}

template <class R>
Request read_end(const json& message, const char* op, const char* key) {
  auto ids = read_ids(message, op, key);
  if (auto* refused = std::get_if<Refused>(&ids)) return std::move(*refused);
  return R{std::get<0>(std::move(ids))};
}

Request read_advertise(const json& message) {
  Advertise request;
  const auto list = message.find("channels");
  if (list == message.end() || !list->is_array()) return Refused{"advertise: \"channels\" is no list"};
  const auto is_text = [](const json& one, const char* key) { return one.contains(key) && one[key].is_string(); };
  for (const json& one : *list) {
    const auto id = one.is_object() && one.contains("id") ? id_of(one["id"]) : std::nullopt;
    if (!id || !is_text(one, "topic") || !is_text(one, "encoding"))
      return Refused{"advertise: each channel needs \"id\", \"topic\" and \"encoding\""};
    request.publications.push_back({*id, one["topic"], one["encoding"]});
  }
  return request;
}

}  // namespace

std::string server_info_text(const std::string& name, const std::string& session, std::uint32_t connection) {
  return text_of({{"op", "serverInfo"},
                  {"name", name},
                  {"capabilities", {"clientPublish"}},
                  {"supportedEncodings", {"cdr"}},
                  {"metadata", {{"subworld", version_text()}, {"connection", std::to_string(connection)}}},
                  {"sessionId", session}});
}

std::string advertise_text(const std::vector<Channel>& channels) {
  json list = json::array();
  for (const Channel& channel : channels) {
    list.push_back({{"id", channel.id},
                    {"topic", channel.topic},
                    {"encoding", "cdr"},
                    {"schemaName", channel.type},
                    {"schemaEncoding", "omgidl"},
                    {"schema", channel.schema}});
  }
  return text_of({{"op", "advertise"}, {"channels", std::move(list)}});
}

std::string status_text(Level level, const std::string& message, const std::string& id) {
  json status{{"op", "status"}, {"level", static_cast<int>(level)}, {"message", message}};
  if (!id.empty()) status["id"] = id;
  return text_of(status);
}

std::array<std::uint8_t, 13> data_header(std::uint32_t subscription, std::uint64_t time_ns) noexcept {
  std::array<std::uint8_t, 13> header{1};
  for (std::size_t i = 0; i < 4; ++i) header[1 + i] = static_cast<std::uint8_t>(subscription >> (8 * i));
  for (std::size_t i = 0; i < 8; ++i) header[5 + i] = static_cast<std::uint8_t>(time_ns >> (8 * i));
  return header;
}

Request parse_request(std::string_view text) {
  const json message = json::parse(text, nullptr, false);
  if (message.is_discarded()) return Refused{"the message is not JSON"};
  const auto op = message.is_object() ? message.find("op") : message.end();
  if (!message.is_object() || op == message.end() || !op->is_string()) return Refused{"the message has no \"op\""};
  const auto& name = op->get_ref<const std::string&>();
  if (name == "subscribe") return read_subscribe(message);
  if (name == "unsubscribe") return read_end<Unsubscribe>(message, "unsubscribe", "subscriptionIds");
  if (name == "advertise") return read_advertise(message);
  if (name == "unadvertise") return read_end<Unadvertise>(message, "unadvertise", "channelIds");
  return Refused{fmt::format(
      "\"{}\" is not served: this server knows subscribe, unsubscribe, advertise and unadvertise", name.substr(0, 40))};
}

Request parse_binary(std::span<const std::uint8_t> message) {
  constexpr std::size_t kHead = 5;
  constexpr std::uint8_t kMessageData = 1;
  if (message.size() < kHead || message[0] != kMessageData)
    return Refused{"the binary message is not served: this server takes client messages (opcode 1)"};
  std::uint32_t id = 0;
  for (std::size_t i = 0; i < 4; ++i) id |= static_cast<std::uint32_t>(message[1 + i]) << (8 * i);
  return Publish{id, message.subspan(kHead)};
}

}  // namespace subworld::live
