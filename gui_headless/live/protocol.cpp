#include "protocol.hpp"

#include "io/results/json.hpp"
#include "io/version.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <limits>
#include <stdexcept>
#include <tuple>
#include <utility>

namespace subworld::live {
namespace {

Request refused(std::string why) { return {.items = {}, .bytes = {}, .why = std::move(why)}; }

std::uint32_t id_of(const Json& value) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (!value.is_number_unsigned() || value.get<std::uint64_t>() > kMost)
    throw std::runtime_error(fmt::format("an id is a number from 0 to {}", kMost));
  return value.get<std::uint32_t>();
}

}  // namespace

std::string server_info_text(const std::string& name, const std::string& session, std::uint32_t connection) {
  return json_text({{"op", "serverInfo"},
                    {"name", name},
                    {"capabilities", {"clientPublish"}},
                    {"supportedEncodings", {"cdr"}},
                    {"metadata", {{"subworld", version_text()}, {"connection", std::to_string(connection)}}},
                    {"sessionId", session}});
}

std::string advertise_text(const std::vector<Channel>& channels) {
  Json list = Json::array();
  for (const Channel& channel : channels) {
    list.push_back({{"id", channel.id},
                    {"topic", channel.topic},
                    {"encoding", "cdr"},
                    {"schemaName", channel.type},
                    {"schemaEncoding", "omgidl"},
                    {"schema", channel.schema}});
  }
  return json_text({{"op", "advertise"}, {"channels", std::move(list)}});
}

std::string status_text(Level level, const std::string& message, const std::string& id) {
  Json status{{"op", "status"}, {"level", static_cast<int>(level)}, {"message", message}};
  if (!id.empty()) status["id"] = id;
  return json_text(status);
}

std::array<std::uint8_t, 13> data_header(std::uint32_t subscription, std::uint64_t time_ns) noexcept {
  std::array<std::uint8_t, 13> header{1};
  for (std::size_t i = 0; i < 4; ++i) header[1 + i] = static_cast<std::uint8_t>(subscription >> (8 * i));
  for (std::size_t i = 0; i < 8; ++i) header[5 + i] = static_cast<std::uint8_t>(time_ns >> (8 * i));
  return header;
}

Request parse_request(std::string_view text) {
  using Op = Request::Op;
  constexpr std::array kOps{std::tuple{"subscribe", Op::subscribe, "subscriptions"},
                            std::tuple{"unsubscribe", Op::unsubscribe, "subscriptionIds"},
                            std::tuple{"advertise", Op::advertise, "channels"},
                            std::tuple{"unadvertise", Op::unadvertise, "channelIds"}};
  try {
    const Json message = parse_json(text);
    const auto name = message.at("op").get<std::string>();
    const auto form = std::ranges::find(kOps, name, [](const auto& one) { return std::string(std::get<0>(one)); });
    if (form == kOps.end()) {
      return refused(
          fmt::format("\"{}\" is not served: this server knows subscribe, unsubscribe, advertise and unadvertise",
                      name.substr(0, 40)));
    }
    const auto& [ignored, op, list] = *form;
    Request request{.op = op, .items = {}, .bytes = {}, .why = {}};
    for (const Json& one : message.at(list)) {
      Request::Item& item = request.items.emplace_back();
      item.id = id_of(one.is_object() ? one.at("id") : one);
      if (op == Op::subscribe) item.channel = id_of(one.at("channelId"));
      if (op == Op::advertise) {
        item.topic = one.at("topic");
        item.encoding = one.at("encoding");
      }
    }
    return request;
  } catch (const std::exception& wrong) {
    return refused(fmt::format("the message is no request: {}", wrong.what()));
  }
}

Request parse_binary(std::span<const std::uint8_t> message) {
  constexpr std::size_t kHead = 5;
  constexpr std::uint8_t kMessageData = 1;
  if (message.size() < kHead || message[0] != kMessageData)
    return refused("the binary message is not served: this server takes client messages (opcode 1)");
  Request::Item item;
  for (std::size_t i = 0; i < 4; ++i) item.id |= static_cast<std::uint32_t>(message[1 + i]) << (8 * i);
  return {.op = Request::Op::publish, .items = {item}, .bytes = message.subspan(kHead), .why = {}};
}

}  // namespace subworld::live
