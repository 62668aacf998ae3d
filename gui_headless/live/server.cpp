#include "server.hpp"

#include "model/error.hpp"
#include "orders.hpp"
#include "session.hpp"
#include "sources.hpp"
#include "tools.hpp"

#include <fmt/core.h>
#include <libwebsockets.h>
#include <netdb.h>
#include <netinet/tcp.h>
#include <signal.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <functional>
#include <future>
#include <mutex>
#include <random>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

namespace subworld::live {
namespace {

constexpr std::size_t kMostClients = 32, kMostConnections = 64, kMostSubscriptions = 1024;
constexpr int kSendBufferBytes = 256 << 10;                       // of the kernel, for each client
constexpr unsigned kHeaderBytes = 8U << 10U, kRequestTime_s = 5;  // at most, of a request
constexpr std::chrono::nanoseconds kPeriod{1'000'000'000 / 60};   // the highest rate of a channel
constexpr std::chrono::milliseconds kIdlePeriod{250}, kInspection{500}, kFarewell{500};

constexpr std::string_view kOrderTopic = "/control";

/// The user of "/user_N/tool"; none: it is another topic.
std::optional<int> user_of_tool(std::string_view topic, int users) {
  constexpr std::string_view kBegin = "/user_", kEnd = "/tool";
  if (!topic.starts_with(kBegin) || !topic.ends_with(kEnd)) return std::nullopt;
  topic.remove_prefix(kBegin.size());
  topic.remove_suffix(std::min(kEnd.size(), topic.size()));
  int user = -1;
  const auto [end, fault] = std::from_chars(topic.data(), topic.data() + topic.size(), user);
  if (fault != std::errc{} || end != topic.data() + topic.size() || user < 0 || user >= users) return std::nullopt;
  return user;
}

std::string random_session() {
  std::random_device source;
  return fmt::format("{:08x}{:08x}", source(), source());
}

/// Throws `Error` (failed) where it cannot listen.
int listening_socket(const ServerConfig& config) {
  addrinfo hints{};
  hints.ai_flags = AI_NUMERICHOST;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* at = nullptr;
  int listener = -1;
  std::string fault;
  if (const int code = getaddrinfo(config.address.c_str(), std::to_string(config.port).c_str(), &hints, &at); code != 0)
    fault = gai_strerror(code);
  if (at != nullptr) {
    constexpr int kOn = 1;
    listener = socket(at->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (listener < 0 || setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &kOn, sizeof kOn) != 0 ||
        bind(listener, at->ai_addr, at->ai_addrlen) != 0 || listen(listener, SOMAXCONN) != 0)
      fault = std::strerror(errno);
    freeaddrinfo(at);
  }
  if (fault.empty()) return listener;
  if (listener >= 0) close(listener);
  throw Error(ExitCode::failed,
              fmt::format("cannot serve viewers on {} port {}: {}; choose another --live PORT or --listen ADDRESS",
                          config.address, config.port, fault));
}

/// "127.0.0.1:8765"
std::string address_of(int listener) {
  sockaddr_storage own{};
  socklen_t size = sizeof own;
  std::array<char, NI_MAXHOST> host{};
  std::array<char, NI_MAXSERV> port{};
  getsockname(listener, reinterpret_cast<sockaddr*>(&own), &size);
  getnameinfo(reinterpret_cast<const sockaddr*>(&own), size, host.data(), host.size(), port.data(), port.size(),
              NI_NUMERICHOST | NI_NUMERICSERV);
  return own.ss_family == AF_INET6 ? fmt::format("[{}]:{}", host.data(), port.data())
                                   : fmt::format("{}:{}", host.data(), port.data());
}

void report(const std::exception& fault) { fmt::print(stderr, "gui_headless: viewers: {}\n", fault.what()); }

}  // namespace

struct Server::Parts final : Host {
  Parts(const ServerConfig& wanted, Bus& bus)
      : config(wanted), sources(bus, wanted.users), orders(bus), tools(wanted.domain, wanted.users) {
    context.reset(open_context());
    if (!context) throw Error(ExitCode::failed, "cannot serve viewers: libwebsockets does not start");
    const int socket = listening_socket(config);
    address = address_of(socket);
    listener = watch(socket);
    timer = watch(timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC));
    schedule(kIdlePeriod);
    // Signals go to the main thread.
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    thread = std::thread([this] { work(); });
    pthread_sigmask(SIG_SETMASK, &before, nullptr);
  }

  ~Parts() override {
    post([this] { leave(); });
    thread.join();
  }

  lws_context* open_context() {
    static const std::array<lws_protocols, kProtocols.size() + 1> kNames{
        {{kProtocols[0].data(), on_event, 0, 0, 0, nullptr, kSendBufferBytes},
         {kProtocols[1].data(), on_event, 0, 0, 0, nullptr, kSendBufferBytes},
         {}}};
    static const lws_retry_bo_t kIdle{nullptr, 0,  0,
                                      10,      20, 0};  // seconds to a ping, and to the end without its answer
    lws_set_log_level(0, nullptr);                      // it mentions each wrong client
    lws_context_creation_info info{};
    info.port = CONTEXT_PORT_NO_LISTEN_SERVER;
    info.protocols = kNames.data();
    info.options = LWS_SERVER_OPTION_VALIDATE_UTF8;
    info.fd_limit_per_thread = kMostConnections + 8;
    info.max_http_header_data2 = kHeaderBytes;
    info.timeout_secs = kRequestTime_s;
    info.timeout_secs_ah_idle = kRequestTime_s;
    info.retry_and_idle_policy = &kIdle;
    info.user = this;
    return lws_create_context(&info);
  }

  /// From now on there is an event when it can be read. The library closes it.
  lws* watch(int descriptor) {
    lws_sock_file_fd_type file{};
    file.filefd = descriptor;
    return lws_adopt_descriptor_vhost(vhost(), LWS_ADOPT_RAW_FILE_DESC, file, nullptr, nullptr);
  }
  [[nodiscard]] lws_vhost* vhost() const { return lws_get_vhost_by_name(context.get(), "default"); }

  static int on_event(lws* connection, lws_callback_reasons event, void* user, void* bytes, std::size_t size) {
    try {
      Parts& parts = *static_cast<Parts*>(lws_context_user(lws_get_context(connection)));
      return parts.handle(connection, event, static_cast<Session*>(user), bytes, size);
    } catch (const std::exception& fault) {
      report(fault);
      return -1;
    }
  }

  /// `session`: null where the connection is new, or is none.
  int handle(lws* connection, lws_callback_reasons event, Session* session, const void* bytes, std::size_t size) {
    if (event == LWS_CALLBACK_SERVER_NEW_CLIENT_INSTANTIATED) {
      sessions.push_back(std::make_unique<Session>(connection, *this, ++connections));
      lws_set_wsi_user(connection, sessions.back().get());
    } else if (event == LWS_CALLBACK_RAW_RX_FILE) {
      connection == timer ? tick() : accept();
    } else if (session != nullptr && event == LWS_CALLBACK_WSI_DESTROY) {
      closed(*session);
    } else if (session != nullptr) {
      return session->handle(event, bytes, size);
    }
    return 0;
  }

  void work() noexcept {
    while (!done) {
      lws_service(context.get(), 0);
      std::vector<std::function<void()>> posted;
      {
        const std::lock_guard lock(mutex);
        posted.swap(tasks);
      }
      for (const auto& task : posted) {
        try {
          task();
        } catch (const std::exception& fault) {
          report(fault);
        }
      }
    }
  }

  /// Does this in the thread of the server.
  void post(std::function<void()> task) {
    const std::lock_guard lock(mutex);
    tasks.push_back(std::move(task));
    lws_cancel_service(context.get());
  }

  void accept() {
    const int socket = accept4(lws_get_socket_fd(listener), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (socket < 0) {  // as where no file is left to open
      lws_rx_flow_control(listener, 0);
      return;
    }
    if (sessions.size() >= kMostConnections) {
      close(socket);
      return;
    }
    constexpr int kOn = 1;
    setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &kOn, sizeof kOn);
    setsockopt(socket, SOL_SOCKET, SO_SNDBUF, &kSendBufferBytes, sizeof kSendBufferBytes);
    lws_adopt_socket_vhost(vhost(), socket);
  }

  void schedule(std::chrono::nanoseconds period) {
    itimerspec once{};
    once.it_value.tv_nsec = period.count();
    timerfd_settime(lws_get_socket_fd(timer), 0, &once, nullptr);
  }

  void tick() {
    if (leaving) {
      done = true;
      return;
    }
    schedule(subscribers > 0 ? kPeriod : std::chrono::nanoseconds(kIdlePeriod));
    lws_rx_flow_control(listener, 1);
    if (subscribers > 0) sources.poll(deliver);
    if (const auto now = Session::Clock::now(); now >= next_inspection) {
      next_inspection = now + kInspection;
      orders.inspect(now);
      tools.inspect(now);
      show_tools();
      for (const auto& session : sessions) session->inspect(now);
    }
  }

  void leave() {
    leaving = true;
    done = sessions.empty();
    lws_set_timeout(listener, PENDING_TIMEOUT_USER_OK, LWS_TO_KILL_ASYNC);
    for (const auto& session : sessions) session->close();
    schedule(kFarewell);
  }

  [[nodiscard]] const std::string& token() const override { return config.token; }
  [[nodiscard]] bool full() const override {
    return std::ranges::count_if(sessions, [](const auto& one) { return one->is_open(); }) >=
           static_cast<std::ptrdiff_t>(kMostClients);
  }

  void opened(Session& session) override {
    session.send_control(server_info_text(fmt::format("Subworld: {}", config.name), session_id, session.number()));
    session.send_control(advertise_text(sources.channels()));
  }

  void requested(Session& session, const Request& request) override {
    if (const auto* wanted = std::get_if<Subscribe>(&request)) {
      for (const Subscription& one : wanted->subscriptions) subscribe(session, one);
    } else if (const auto* ended = std::get_if<Unsubscribe>(&request)) {
      for (const std::uint32_t id : ended->subscriptions) unsubscribe(session, id);
    } else if (const auto* offered = std::get_if<Advertise>(&request)) {
      for (const Publication& one : offered->publications) advertise(session, one);
    } else if (const auto* withdrawn = std::get_if<Unadvertise>(&request)) {
      for (const std::uint32_t id : withdrawn->publications) withdraw(session, id);
    } else if (const auto* published = std::get_if<Publish>(&request)) {
      publish(session, *published);
    } else {
      session.send_control(status_text(Level::error, std::get<Refused>(request).why));
    }
  }

  void advertise(Session& session, const Publication& offered) {
    const auto refuse = [&](const std::string& why) {
      session.send_control(status_text(Level::error, fmt::format("channel {}: {}", offered.id, why)));
    };
    const std::optional<int> user = user_of_tool(offered.topic, config.users);
    if ((offered.topic != kOrderTopic && !user) || offered.encoding != "cdr")
      return refuse(fmt::format("this server takes messages of {} and of /user_N/tool in cdr only", kOrderTopic));
    if (!session.may_publish())
      return refuse(
          "a page of another site may not give orders or hold tools; start the display with a token, and give it");
    if (session.publications.size() >= kMostSubscriptions) return refuse("too many channels");
    session.publications[offered.id] = user;
  }

  void publish(Session& session, const Publish& message) {
    const auto known = session.publications.find(message.publication);
    const auto now = Session::Clock::now();
    std::string fault;
    if (known == session.publications.end()) {
      fault = fmt::format("channel {} is not advertised", message.publication);
    } else if (const std::optional<int> user = known->second) {
      if (over) return;
      fault = tools.move(*user, session.number(), message.bytes, now);
      show_tools();
    } else {
      fault = orders.send(message.bytes, now);
    }
    if (!fault.empty()) session.send_control(status_text(Level::error, fault));
  }

  void withdraw(Session& session, std::uint32_t id) {
    const auto known = session.publications.find(id);
    if (known == session.publications.end()) return;
    if (known->second) tools.release(*known->second, session.number());
    session.publications.erase(known);
    show_tools();
  }

  void show_tools() {
    if (auto cdr = tools.news()) sources.show(kToolsTopic, std::move(*cdr), deliver);
  }

  void subscribe(Session& session, const Subscription& wanted) {
    const auto refuse = [&](const std::string& why) {
      session.send_control(status_text(Level::error, fmt::format("subscription {}: {}", wanted.id, why)));
    };
    const Channel* channel = sources.channel(wanted.channel);
    if (channel == nullptr) return refuse(fmt::format("there is no channel {}", wanted.channel));
    if (session.subscriptions.contains(wanted.id)) return refuse("this id is in use");
    if (session.subscriptions.size() >= kMostSubscriptions) return refuse("too many subscriptions");
    try {
      sources.subscribe(*channel);
    } catch (const std::exception& fault) {
      return refuse(fault.what());
    }
    session.subscriptions[wanted.id] = wanted.channel;
    if (subscribers++ == 0) schedule(kPeriod);
    for (const Sample& sample : sources.newest(*channel)) session.send_data(wanted.id, sample);
  }

  void unsubscribe(Session& session, std::uint32_t id) {
    const auto known = session.subscriptions.find(id);
    if (known == session.subscriptions.end()) {
      return session.send_control(status_text(Level::error, fmt::format("there is no subscription {}", id)));
    }
    sources.unsubscribe(*sources.channel(known->second));
    --subscribers;
    session.subscriptions.erase(known);
    session.forget(id);
  }

  void closed(Session& session) {
    for (const auto& [id, channel] : session.subscriptions) {
      sources.unsubscribe(*sources.channel(channel));
      --subscribers;
    }
    session.subscriptions.clear();
    if (!leaving) tools.release(session.number());  // the end of the run is no absence of a device
    show_tools();
    std::erase_if(sessions, [&](const auto& one) { return one.get() == &session; });
    if (leaving && sessions.empty()) done = true;
  }

  const ServerConfig config;
  const std::string session_id = random_session();
  std::string address;
  Sources sources;
  Orders orders;
  Tools tools;
  std::uint32_t connections = 0;
  int subscribers = 0;
  bool over = false;
  bool leaving = false;
  bool done = false;
  Session::Clock::time_point next_inspection;
  std::vector<std::unique_ptr<Session>> sessions;
  const Sources::Deliver deliver = [this](const Channel& channel, const Sample& sample) {
    for (const auto& session : sessions)
      for (const auto& [id, subscribed] : session->subscriptions)
        if (subscribed == channel.id) session->send_data(id, sample);
  };

  std::mutex mutex;
  std::vector<std::function<void()>> tasks;
  struct Closer {
    void operator()(lws_context* one) const { lws_context_destroy(one); }
  };
  std::unique_ptr<lws_context, Closer> context;  // ends the sessions
  lws *listener = nullptr, *timer = nullptr;
  std::thread thread;
};

Server::Server(const ServerConfig& config, Bus& bus) : parts_(std::make_unique<Parts>(config, bus)) {}
Server::~Server() = default;

void Server::describe(const SceneDescription& scene) {
  parts_->post([parts = parts_.get(), copy = std::make_shared<const SceneDescription>(scene)] {
    parts->sources.describe(copy, parts->deliver);
  });
}

void Server::place(ProgramKind program, std::uint32_t instance, const PeerProgram& peer) {
  parts_->post([parts = parts_.get(), program, instance, peer] {
    parts->sources.place(program, instance, peer, parts->deliver);
  });
}

void Server::end_run() {
  parts_->post([parts = parts_.get()] { parts->over = true; });
}

bool Server::verdict_is_awaited() const {
  std::promise<bool> answer;
  parts_->post([&] { answer.set_value(parts_->sources.verdict_is_awaited()); });
  return answer.get_future().get();
}

void Server::show_verdict(std::vector<std::uint8_t> cdr) {
  parts_->post([parts = parts_.get(), cdr = std::move(cdr)]() mutable {
    parts->sources.show(kVerdictTopic, std::move(cdr), parts->deliver);
  });
}

const std::string& Server::address() const noexcept { return parts_->address; }

}  // namespace subworld::live
