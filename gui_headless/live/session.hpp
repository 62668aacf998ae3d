#pragma once

#include "outbox.hpp"
#include "protocol.hpp"

#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>

#include <array>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>

/// The only files with Boost.Beast are session.* and server.cpp: its headers take long to compile.
namespace subworld::live {

namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;

class Session;

/// The server, as its sessions see it.
class Host {
 public:
  virtual ~Host() = default;
  [[nodiscard]] virtual const std::string& token() const = 0;
  [[nodiscard]] virtual bool full() const = 0;
  /// The client speaks the protocol now.
  virtual void opened(Session& session) = 0;
  virtual void requested(Session& session, const Request& request) = 0;
  virtual void closed(Session& session) = 0;
};

/// The connection of one client, from its HTTP request to its end. One thread.
class Session : public std::enable_shared_from_this<Session> {
 public:
  using Clock = std::chrono::steady_clock;

  /// `number` is that of no other connection, and not 0.
  Session(boost::asio::ip::tcp::socket&& socket, Host& host, std::uint32_t number);
  void start();

  /// Ends the connection if too many control messages wait.
  void send_control(std::string text);
  void send_data(std::uint32_t subscription, const Sample& sample);
  void forget(std::uint32_t subscription) { outbox_.forget(subscription); }
  /// Once in a while: tells the client of dropped samples, and ends a connection whose client does not read.
  void inspect(Clock::time_point now);
  /// Once all that waits is sent.
  void close(websocket::close_code code, const std::string& reason);

  [[nodiscard]] std::uint32_t number() const noexcept { return number_; }
  [[nodiscard]] bool is_open() const noexcept { return open_; }

  /// Whether this client may give orders and hold tools: not the page of another site, which the user's browser happens
  /// to show.
  [[nodiscard]] bool may_publish() const noexcept { return may_publish_; }

  std::map<std::uint32_t, std::uint32_t> subscriptions;      ///< channel of each
  std::map<std::uint32_t, std::optional<int>> publications;  ///< of each of its ids: the user whose tool; none: orders

 private:
  void answer_request();
  void refuse(http::status status, const std::string& text);
  void send_page();
  void respond();
  void accept(std::string_view protocol);
  void read();
  void write();
  void end();
  /// Closes the socket. What is written is sent.
  void abort() noexcept;
  /// The same, but what the client has not taken is dropped, which frees its memory in the kernel.
  void reset() noexcept;

  websocket::stream<beast::tcp_stream, false> stream_;  // without compression
  Host& host_;
  const std::uint32_t number_;
  beast::flat_buffer buffer_;
  std::optional<http::request_parser<http::string_body>> parser_;
  http::response<http::string_body> response_;
  Outbox outbox_;
  std::optional<Outbox::Message> writing_;
  std::optional<websocket::close_reason> farewell_;
  std::array<std::uint8_t, 13> header_{};
  Clock::time_point write_began_;
  std::uint64_t reported_drops_ = 0;
  bool may_publish_ = false;
  bool open_ = false;
  bool closing_ = false;
  bool ended_ = false;
};

}  // namespace subworld::live
