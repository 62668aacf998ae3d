#include "session.hpp"

#include <arpa/inet.h>
#include <fmt/core.h>
#include <libwebsockets.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <strings.h>

#include <algorithm>
#include <array>
#include <span>
#include <utility>
#include <vector>

namespace subworld::live {

/// The page of web/, as compressed HTML. Empty in a build without Node.js. Generated in the build folder.
[[nodiscard]] std::span<const std::uint8_t> page_gzip() noexcept;

namespace {

constexpr std::size_t kMostMessageBytes = 64U << 10U;  // of a client
constexpr std::string_view kPageHeaders =
    "Content-Type: text/html; charset=utf-8\r\n"
    "Content-Encoding: gzip\r\n"
    "Cache-Control: no-store\r\n"
    "Content-Security-Policy: default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; connect-src 'self' ws:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n"
    "Referrer-Policy: no-referrer\r\n"  // the address may hold the token
    "X-Content-Type-Options: nosniff\r\n";
constexpr std::chrono::seconds kStuck{10};
constexpr std::size_t kLastBytes = 128U << 10U;                   // of data, at the end of the run
constexpr std::size_t kMostViewers = 32, kMostOtherViewers = 24;  // other than own pages, or clients with the token
constexpr int kMostHostBytes = 256;
// Foxglove and Lichtblick as web sites, Lichtblick in a container, and both as desktop programs.
constexpr std::array<std::string_view, 5> kViewers{"https://app.foxglove.dev", "https://studio.foxglove.dev",
                                                   "https://lichtblick-suite.github.io", "http://localhost:8080",
                                                   "file://"};

/// Takes as long for any text of that length.
bool is_equal(std::string_view a, std::string_view b) {
  unsigned differ = a.size() == b.size() ? 0 : 1;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
    differ |= static_cast<unsigned char>(a[i]) ^ static_cast<unsigned char>(b[i]);
  return differ == 0;
}

/// Empty: the request has no such header.
std::string header_of(lws* request, lws_token_indexes header) {
  std::string text(static_cast<std::size_t>(lws_hdr_total_length(request, header)) + 1, '\0');
  text.resize(
      static_cast<std::size_t>(std::max(0, lws_hdr_copy(request, text.data(), static_cast<int>(text.size()), header))));
  return text;
}

/// From the header "Authorization: Bearer TOKEN" or, because a browser sets no header, from "?token=TOKEN".
std::string token_of(lws* request) {
  constexpr std::string_view kBearer = "Bearer ";
  const std::string header = header_of(request, WSI_TOKEN_HTTP_AUTHORIZATION);
  if (strncasecmp(header.c_str(), kBearer.data(), kBearer.size()) == 0) return header.substr(kBearer.size());
  // libwebsockets 4.3 needs room for two bytes more.
  std::string query(static_cast<std::size_t>(lws_hdr_total_length(request, WSI_TOKEN_HTTP_URI_ARGS)) + 2, '\0');
  const char* token = lws_get_urlarg_by_name(request, "token=", query.data(), static_cast<int>(query.size()));
  return token != nullptr ? token : "";
}

/// The first host that a proxy was asked for. The script of a page cannot set a header of a WebSocket.
std::string forwarded_host(lws* request) {
  constexpr std::string_view kName = "x-forwarded-host:";
  std::string text(kMostHostBytes, '\0');
  text.resize(static_cast<std::size_t>(std::max(
      0, lws_hdr_custom_copy(request, text.data(), kMostHostBytes, kName.data(), static_cast<int>(kName.size())))));
  return text.substr(0, text.find(','));
}

/// An address or localhost: a name that another site controls may lead to this server.
bool is_safe_host(const std::string& host) {
  const std::string name = host.starts_with('[') ? host.substr(1, host.find(']') - 1) : host.substr(0, host.find(':'));
  in6_addr address{};
  return name == "localhost" || inet_pton(AF_INET, name.c_str(), &address) == 1 ||
         inet_pton(AF_INET6, name.c_str(), &address) == 1;
}

/// Of the page that sends a request. A browser names its site; other programs do not.
enum class Site : std::uint8_t { none, own, allowed, foreign };

Site site_of(lws* request, const std::vector<std::string>& origins) {
  const std::string from = header_of(request, WSI_TOKEN_ORIGIN), to = header_of(request, WSI_TOKEN_HOST);
  if (from.empty()) return Site::none;
  const bool allowed = std::ranges::find(kViewers, from) != kViewers.end() || std::ranges::count(origins, from) > 0;
  const auto is_page_of = [&](const std::string& host) {
    return from == "http://" + host || from == "https://" + host;
  };
  if (is_page_of(forwarded_host(request)) || (is_page_of(to) && (allowed || is_safe_host(to)))) return Site::own;
  return allowed ? Site::allowed : Site::foreign;
}

}  // namespace

/// A connection has one request, also because of a fault in the library: it answers an unknown upgrade itself, and uses
/// freed memory where another request follows (CVE-2025-11677).
int Session::answer_request(const std::string& token, const std::vector<std::string>& origins, std::size_t viewers) {
  const bool trusted = !token.empty();
  if (trusted && !is_equal(token_of(connection_), token)) {
    return refuse("401 Unauthorized",
                  "the token is missing or wrong: give it as ADDRESS:PORT/?token=TOKEN or in the header "
                  "\"Authorization: Bearer TOKEN\"");
  }
  if (strcasecmp(header_of(connection_, WSI_TOKEN_UPGRADE).c_str(), "websocket") != 0) return send_page();
  const std::string offered = header_of(connection_, WSI_TOKEN_PROTOCOL);
  if (std::ranges::none_of(kProtocols,
                           [&](std::string_view ours) { return offered.find(ours) != std::string::npos; })) {
    return refuse("400 Bad Request",
                  fmt::format("offer the WebSocket subprotocol {} or {}", kProtocols[0], kProtocols[1]));
  }
  const Site site = site_of(connection_, origins);
  if (!trusted && site == Site::foreign) {
    return refuse("403 Forbidden",
                  "a page of another site may not read this run: start the display with --origin SITE, as "
                  "https://example.org, or with a token, and give it");
  }
  if (viewers >= (trusted || site == Site::own ? kMostViewers : kMostOtherViewers))
    return refuse("503 Service Unavailable", "too many viewers are connected");
  may_publish_ = trusted || site == Site::own || site == Site::none;
  return 0;
}

int Session::send_page() {
  char* path = nullptr;
  int size = 0;
  const int method = lws_http_get_uri_and_method(connection_, &path, &size);
  if (method != LWSHUMETH_GET && method != LWSHUMETH_HEAD) return refuse("405 Method Not Allowed", "use GET");
  if (std::string_view(path, static_cast<std::size_t>(size)) != "/") return refuse("404 Not Found", "the page is at /");
  const std::span<const std::uint8_t> page = page_gzip();
  if (page.empty()) {
    return refuse(
        "501 Not Implemented",
        "This build of Subworld has no page: the build found no Node.js or npm, or could not fetch the page's "
        "packages. Install nodejs and npm and build again. Lichtblick and Foxglove work all the same: open "
        "this address as ws:// (Open connection, Foxglove WebSocket).");
  }
  return respond("200 OK", kPageHeaders, {reinterpret_cast<const char*>(page.data()), page.size()});
}

int Session::refuse(std::string_view status, const std::string& text) {
  return respond(status, "Content-Type: text/plain; charset=utf-8\r\n", text + "\n");
}

int Session::respond(std::string_view status, std::string_view headers, std::string_view body) {
  std::string text(LWS_PRE, '\0');
  text += fmt::format("HTTP/1.1 {}\r\nConnection: close\r\nContent-Length: {}\r\n{}\r\n", status, body.size(), headers);
  char* path = nullptr;
  int size = 0;
  if (lws_http_get_uri_and_method(connection_, &path, &size) != LWSHUMETH_HEAD) text += body;
  lws_write(connection_, reinterpret_cast<unsigned char*>(text.data()) + LWS_PRE, text.size() - LWS_PRE,
            LWS_WRITE_HTTP_HEADERS);
  return -1;
}

int Session::read(const void* bytes, std::size_t size, const std::function<void(const Request&)>& requested) {
  if (closing_) return 0;
  if (received_.size() + size > kMostMessageBytes) {
    lws_close_reason(connection_, LWS_CLOSE_STATUS_MESSAGE_TOO_LARGE, nullptr, 0);
    return -1;
  }
  received_.append(static_cast<const char*>(bytes), size);
  if (lws_is_final_fragment(connection_) == 0) return 0;
  const std::string message = std::exchange(received_, {});
  requested(lws_frame_is_binary(connection_) != 0
                ? parse_binary({reinterpret_cast<const std::uint8_t*>(message.data()), message.size()})
                : parse_request(message));
  return 0;
}

void Session::send_control(std::string text) {
  if (!open_ || closing_) return;
  if (!outbox_.add_control(std::move(text))) return reset();
  await_write();
}

void Session::send_data(std::uint32_t subscription, const Sample& sample) {
  if (!open_ || closing_ || farewell_) return;
  outbox_.add_data(subscription, sample);
  await_write();
}

void Session::await_write() {
  if (write_awaited_) return;
  write_awaited_ = Clock::now();
  lws_callback_on_writable(connection_);
}

int Session::write() {
  write_awaited_.reset();
  if (closing_) return 0;
  const std::optional<Outbox::Message> message = outbox_.take();
  if (!message && farewell_) {
    std::string reason = "the run ended";
    lws_close_reason(connection_, LWS_CLOSE_STATUS_GOINGAWAY, reinterpret_cast<unsigned char*>(reason.data()),
                     reason.size());
    return -1;
  }
  if (!message) return 0;
  std::vector<unsigned char> frame(LWS_PRE);
  if (message->data) {
    const Sample& sample = message->data->sample;
    const auto header = data_header(message->data->subscription, sample.time_ns);
    frame.reserve(frame.size() + header.size() + sample.bytes->size());
    frame.insert(frame.end(), header.begin(), header.end());
    frame.insert(frame.end(), sample.bytes->begin(), sample.bytes->end());
  } else {
    frame.insert(frame.end(), message->text.begin(), message->text.end());
  }
  await_write();  // the library first sends the rest of this message
  return std::min(0, lws_write(connection_, frame.data() + LWS_PRE, frame.size() - LWS_PRE,
                               message->data ? LWS_WRITE_BINARY : LWS_WRITE_TEXT));
}

void Session::inspect(Clock::time_point now) {
  if (!open_ || closing_) return;
  if (write_awaited_ && now - *write_awaited_ > kStuck) return reset();
  if (outbox_.dropped() == reported_drops_) return;
  const std::uint64_t more = outbox_.dropped() - reported_drops_;
  reported_drops_ = outbox_.dropped();
  send_control(
      status_text(Level::warning,
                  fmt::format("this client reads too slowly: {} messages were dropped, {} in total; the newest "
                              "of each topic are sent",
                              more, reported_drops_),
                  "dropped"));
}

void Session::close() {
  if (!open_) return reset();
  // All fits into the kernel's memory, which sends it also when this program has ended: a browser may be too busy now.
  constexpr int kAsSystem = 0;
  setsockopt(lws_get_socket_fd(connection_), IPPROTO_TCP, TCP_NOTSENT_LOWAT, &kAsSystem, sizeof kAsSystem);
  outbox_.shrink(kLastBytes);
  farewell_ = true;
  await_write();
}

void Session::reset() noexcept {
  closing_ = true;
  constexpr linger kDrop{.l_onoff = 1, .l_linger = 0};
  setsockopt(lws_get_socket_fd(connection_), SOL_SOCKET, SO_LINGER, &kDrop, sizeof kDrop);
  lws_set_timeout(connection_, PENDING_TIMEOUT_USER_OK, LWS_TO_KILL_ASYNC);
}

}  // namespace subworld::live
