#pragma once

#include "outbox.hpp"
#include "protocol.hpp"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

struct lws;

namespace subworld::live {

/// The connection of one client, from its HTTP request to its end. One thread.
class Session {
 public:
  using Clock = std::chrono::steady_clock;

  /// `number` is that of no other connection, and not 0.
  Session(lws* connection, std::uint32_t number) : connection_(connection), number_(number) {}

  // Events of the connection. Less than 0 ends it.
  /// Sends the page or a refusal, or lets the library go on to WebSocket. `token`: empty where none is needed.
  /// `origins`: of other sites whose pages may read. `viewers`: how many are connected.
  [[nodiscard]] int answer_request(const std::string& token, const std::vector<std::string>& origins,
                                   std::size_t viewers);
  /// The client speaks the protocol now.
  void open() noexcept { open_ = true; }
  [[nodiscard]] int read(const void* bytes, std::size_t size, const std::function<void(const Request&)>& requested);
  [[nodiscard]] int write();
  /// The library closes the connection, after a wrong frame for example.
  void closing() noexcept { closing_ = true; }

  /// Ends the connection if too many control messages wait.
  void send_control(std::string text);
  void send_data(std::uint32_t subscription, const Sample& sample);
  void forget(std::uint32_t subscription) { outbox_.forget(subscription); }
  /// Once in a while: tells the client of dropped samples, and ends a connection whose client does not read.
  void inspect(Clock::time_point now);
  /// Drops the connection at the next event. What the client has not taken is dropped too, which frees its memory in
  /// the kernel.
  void reset() noexcept;
  /// The run has ended. Closes the connection once all that waits is sent.
  void close();

  [[nodiscard]] std::uint32_t number() const noexcept { return number_; }
  [[nodiscard]] bool is_open() const noexcept { return open_; }
  [[nodiscard]] bool is_closing() const noexcept { return closing_; }

  /// Whether this client may give orders and hold tools: not the page of another site, which the user's browser happens
  /// to show.
  [[nodiscard]] bool may_publish() const noexcept { return may_publish_; }

  std::map<std::uint32_t, std::uint32_t> subscriptions;      ///< channel of each
  std::map<std::uint32_t, std::optional<int>> publications;  ///< of each of its ids: the user whose tool; none: orders

 private:
  int send_page();
  int refuse(std::string_view status, const std::string& text);
  int respond(std::string_view status, std::string_view headers, std::string_view body);
  /// write() is called when the client takes more.
  void await_write();

  lws* const connection_;
  const std::uint32_t number_;
  std::string received_;  // of a message
  Outbox outbox_;
  std::optional<Clock::time_point> write_awaited_;  // since when
  std::uint64_t reported_drops_ = 0;
  bool may_publish_ = false;
  bool open_ = false;
  bool farewell_ = false;
  bool closing_ = false;
};

}  // namespace subworld::live
