#include "session.hpp"

#include "page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace subworld::live {
namespace {

namespace asio = boost::asio;

constexpr std::size_t kMostMessageBytes = 64U << 10U;  // of a client
constexpr int kSendBufferBytes = 256 << 10;            // of the kernel, for each client
constexpr const char* kPagePolicy =
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; connect-src "
    "'self' "
    "ws:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
constexpr std::chrono::seconds kRequestTime{5}, kIdle{20}, kStuck{10};

/// Takes as long for any text of that length.
bool is_equal(std::string_view a, std::string_view b) {
  unsigned differ = a.size() == b.size() ? 0 : 1;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
    differ |= static_cast<unsigned char>(a[i]) ^ static_cast<unsigned char>(b[i]);
  return differ == 0;
}

/// From the header "Authorization: Bearer TOKEN" or, because a browser sets no header, from "?token=TOKEN".
std::string token_of(const http::request<http::string_body>& request) {
  constexpr std::string_view kBearer = "Bearer ", kName = "token=";
  const auto header = request[http::field::authorization];
  if (const std::string_view text{header.data(), header.size()}; text.starts_with(kBearer))
    return std::string(text.substr(kBearer.size()));
  std::string_view query{request.target().data(), request.target().size()};
  query.remove_prefix(std::min(query.find('?'), query.size()));
  while (!query.empty()) {
    query.remove_prefix(1);
    const std::string_view part = query.substr(0, query.find('&'));
    if (part.starts_with(kName)) return std::string(part.substr(kName.size()));
    query.remove_prefix(part.size());
  }
  return {};
}

/// The first protocol of the server that the client offers; empty: none.
std::string_view chosen_protocol(const http::request<http::string_body>& request) {
  const http::token_list offered{request[http::field::sec_websocket_protocol]};
  for (const std::string_view ours : kProtocols) {
    for (const auto& theirs : offered)
      if (ours == std::string_view(theirs.data(), theirs.size())) return ours;
  }
  return {};
}

std::string_view path_of(const http::request<http::string_body>& request) {
  const std::string_view target{request.target().data(), request.target().size()};
  return target.substr(0, target.find('?'));
}

/// Whether the request comes from no browser, or from a page of this server. A browser names the site of the page. A
/// name that another site controls may lead to this address, so the host must be an address or localhost.
bool is_own_page(const http::request<http::string_body>& request) {
  const auto origin = request[http::field::origin], host = request[http::field::host];
  if (origin.empty()) return true;
  const std::string_view from{origin.data(), origin.size()}, to{host.data(), host.size()};
  if (from != fmt::format("http://{}", to)) return false;
  const std::string_view name = to.starts_with('[') ? to.substr(1, to.find(']') - 1) : to.substr(0, to.find(':'));
  boost::system::error_code fault;
  asio::ip::make_address(std::string(name), fault);
  return name == "localhost" || !fault;
}

}  // namespace

Session::Session(asio::ip::tcp::socket&& socket, Host& host, std::uint32_t number)
    : stream_(std::move(socket)), host_(host), number_(number) {
  boost::system::error_code ignored;
  auto& own = beast::get_lowest_layer(stream_).socket();
  own.set_option(asio::ip::tcp::no_delay(true), ignored);
  own.set_option(asio::socket_base::send_buffer_size(kSendBufferBytes), ignored);
}

void Session::start() {
  parser_.emplace();
  parser_->header_limit(8U << 10U);
  parser_->body_limit(1U << 10U);
  beast::get_lowest_layer(stream_).expires_after(kRequestTime);
  http::async_read(beast::get_lowest_layer(stream_), buffer_, *parser_,
                   [self = shared_from_this()](beast::error_code fault, std::size_t) {
                     if (!fault) return self->answer_request();
                     if (fault == beast::error::timeout || fault == http::error::end_of_stream ||
                         fault.category() == asio::error::get_system_category())
                       return self->end();
                     self->refuse(http::status::bad_request, "this is no HTTP request: " + fault.message());
                   });
}

void Session::answer_request() {
  const auto& request = parser_->get();
  if (!host_.token().empty() && !is_equal(token_of(request), host_.token())) {
    return refuse(http::status::unauthorized,
                  "the token is missing or wrong: give it as ADDRESS:PORT/?token=TOKEN or in the header "
                  "\"Authorization: Bearer TOKEN\"");
  }
  if (!websocket::is_upgrade(request)) return send_page();
  const std::string_view protocol = chosen_protocol(request);
  if (protocol.empty()) {
    return refuse(http::status::bad_request,
                  fmt::format("offer the WebSocket subprotocol {} or {}", kProtocols[0], kProtocols[1]));
  }
  if (buffer_.size() > 0) return refuse(http::status::bad_request, "wait for the answer before sending messages");
  if (host_.full()) return refuse(http::status::service_unavailable, "too many viewers are connected");
  may_publish_ = !host_.token().empty() || is_own_page(request);
  accept(protocol);
}

void Session::send_page() {
  const auto& request = parser_->get();
  if (request.method() != http::verb::get) return refuse(http::status::method_not_allowed, "use GET");
  if (path_of(request) != "/") return refuse(http::status::not_found, "the page is at /");
  const std::span<const std::uint8_t> page = page_gzip();
  if (page.empty()) {
    return refuse(
        http::status::not_implemented,
        "This build of Subworld has no page: the build found no Node.js or npm, or could not fetch the page's "
        "packages. Install nodejs and npm and build again. Lichtblick and Foxglove work all the same: open "
        "this address as ws:// (Open connection, Foxglove WebSocket).");
  }
  response_ = {http::status::ok, 11};
  response_.set(http::field::content_type, "text/html; charset=utf-8");
  response_.set(http::field::content_encoding, "gzip");
  response_.set(http::field::cache_control, "no-store");
  response_.set("Content-Security-Policy", kPagePolicy);
  response_.set("Referrer-Policy", "no-referrer");  // the address may hold the token
  response_.set("X-Content-Type-Options", "nosniff");
  response_.body().assign(page.begin(), page.end());
  respond();
}

void Session::refuse(http::status status, const std::string& text) {
  response_ = {status, 11};
  response_.set(http::field::content_type, "text/plain; charset=utf-8");
  response_.body() = text + "\n";
  respond();
}

void Session::respond() {
  response_.keep_alive(false);
  response_.prepare_payload();
  beast::get_lowest_layer(stream_).expires_after(kRequestTime);
  http::async_write(
      beast::get_lowest_layer(stream_), response_, [self = shared_from_this()](beast::error_code, std::size_t) {
        boost::system::error_code ignored;
        beast::get_lowest_layer(self->stream_).socket().shutdown(asio::socket_base::shutdown_send, ignored);
        self->end();
      });
}

void Session::accept(std::string_view protocol) {
  beast::get_lowest_layer(stream_).expires_never();
  stream_.set_option(websocket::stream_base::timeout{kRequestTime, kIdle, true});
  stream_.set_option(websocket::stream_base::decorator([protocol](websocket::response_type& response) {
    response.set(http::field::sec_websocket_protocol, beast::string_view(protocol.data(), protocol.size()));
    response.set(http::field::server, "Subworld");
  }));
  stream_.read_message_max(kMostMessageBytes);
  stream_.async_accept(parser_->get(), [self = shared_from_this()](beast::error_code fault) {
    if (fault) return self->end();
    self->parser_.reset();
    self->open_ = true;
    self->host_.opened(*self);
    self->read();
  });
}

void Session::read() {
  stream_.async_read(buffer_, [self = shared_from_this()](beast::error_code fault, std::size_t) {
    if (fault) return self->end();
    const auto bytes = self->buffer_.data();
    self->host_.requested(*self, self->stream_.got_text()
                                     ? parse_request({static_cast<const char*>(bytes.data()), bytes.size()})
                                     : parse_binary({static_cast<const std::uint8_t*>(bytes.data()), bytes.size()}));
    self->buffer_.clear();
    if (!self->ended_) self->read();
  });
}

void Session::send_control(std::string text) {
  if (!open_ || closing_) return;
  if (!outbox_.add_control(std::move(text))) return reset();
  write();
}

void Session::send_data(std::uint32_t subscription, const Sample& sample) {
  if (!open_ || closing_ || farewell_) return;
  outbox_.add_data(subscription, sample);
  write();
}

void Session::write() {
  if (writing_ || !open_ || closing_) return;
  writing_ = outbox_.take();
  if (!writing_ && farewell_) {
    closing_ = true;
    return stream_.async_close(*farewell_, [self = shared_from_this()](beast::error_code) { self->end(); });
  }
  if (!writing_) return;
  write_began_ = Clock::now();
  auto written = [self = shared_from_this()](beast::error_code fault, std::size_t) {
    self->writing_.reset();
    if (!fault) self->write();  // the reading side notices the end
  };
  if (!writing_->data) {
    stream_.text(true);
    return stream_.async_write(asio::buffer(writing_->text), std::move(written));
  }
  const Sample& sample = writing_->data->sample;
  header_ = data_header(writing_->data->subscription, sample.time_ns);
  stream_.binary(true);
  stream_.async_write(
      std::array{asio::const_buffer(asio::buffer(header_)), asio::const_buffer(asio::buffer(*sample.bytes))},
      std::move(written));
}

void Session::inspect(Clock::time_point now) {
  if (!open_) return;
  if (writing_ && now - write_began_ > kStuck) return reset();
  if (outbox_.dropped() == reported_drops_ || closing_) return;
  const std::uint64_t more = outbox_.dropped() - reported_drops_;
  reported_drops_ = outbox_.dropped();
  send_control(
      status_text(Level::warning,
                  fmt::format("this client reads too slowly: {} messages were dropped, {} in total; the newest "
                              "of each topic are sent",
                              more, reported_drops_),
                  "dropped"));
}

void Session::close(websocket::close_code code, const std::string& reason) {
  if (!open_) return abort();
  farewell_ = {code, reason};
  write();
}

void Session::reset() noexcept {
  boost::system::error_code ignored;
  beast::get_lowest_layer(stream_).socket().set_option(asio::socket_base::linger(true, 0), ignored);
  abort();
}

void Session::abort() noexcept {
  closing_ = true;
  boost::system::error_code ignored;
  beast::get_lowest_layer(stream_).socket().close(ignored);
}

void Session::end() {
  if (std::exchange(ended_, true)) return;
  open_ = false;
  abort();
  host_.closed(*this);
}

}  // namespace subworld::live
