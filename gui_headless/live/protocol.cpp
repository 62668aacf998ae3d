#include "protocol.hpp"

#include "io/version.hpp"

#include <fmt/format.h>
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

Request read_unsubscribe(const json& message) {
  Unsubscribe request;
  const auto list = message.find("subscriptionIds");
  if (list == message.end() || !list->is_array()) return Refused{"unsubscribe: \"subscriptionIds\" is no list"};
  for (const json& one : *list) {
    const auto id = id_of(one);
    if (!id) return Refused{"unsubscribe: an id is a number from 0 to 4294967295"};
    request.subscriptions.push_back(*id);
  }
  return request;
}

}  // namespace

std::string server_info_text(const std::string& name, const std::string& session) {
  return text_of({{"op", "serverInfo"},
                  {"name", name},
                  {"capabilities", json::array()},
                  {"metadata", {{"subworld", version_text()}}},
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
  if (name == "unsubscribe") return read_unsubscribe(message);
  return Refused{fmt::format("\"{}\" is not served: this server knows subscribe and unsubscribe", name.substr(0, 40))};
}

}  // namespace subworld::live
