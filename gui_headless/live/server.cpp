#include "server.hpp"

#include "listener.hpp"
#include "model/error.hpp"
#include "orders.hpp"
#include "session.hpp"
#include "sources.hpp"
#include "tools.hpp"

#include <fmt/core.h>
#include <libwebsockets.h>
#include <netinet/tcp.h>
#include <signal.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <deque>
#include <functional>
#include <future>
#include <mutex>
#include <random>
#include <stdexcept>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

namespace subworld::live {
namespace {

constexpr std::size_t kMostConnections = 64, kMostSubscriptions = 1024;
constexpr int kSendBufferBytes = 256 << 10;                       // of the kernel, for each client
constexpr int kUnsentBytes = 64 << 10;                            // at most there; the rest is for the end of the run
constexpr unsigned kHeaderBytes = 8U << 10U, kRequestTime_s = 5;  // at most, of a request
constexpr std::chrono::nanoseconds kPeriod{1'000'000'000 / 60};   // the highest rate of a channel
constexpr std::chrono::milliseconds kIdlePeriod{250}, kInspection{500}, kFarewell{2000}, kLook{50};

constexpr std::string_view kOrderTopic = "/control";
}  // namespace

struct Server::Parts {
  Parts(const ServerConfig& wanted, Bus& bus)
      : config(wanted), sources(bus, wanted.users), orders(bus), tools(wanted.domain, wanted.users) {
    context.reset(open_context());
    if (!context) throw Error(ExitCode::failed, "cannot serve viewers: libwebsockets does not start");
    const int socket = listening_socket(config.address, config.port);
    address = address_of(config.address, socket);
    listener = adopt(socket, LWS_ADOPT_RAW_FILE_DESC);
    timer = adopt(timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC), LWS_ADOPT_RAW_FILE_DESC);
    schedule(kIdlePeriod);
    // Signals go to the main thread.
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    thread = std::thread([this] {
      while (!done) lws_service(context.get(), 0);
    });
    pthread_sigmask(SIG_SETMASK, &before, nullptr);
  }

  ~Parts() {
    post([this] { leave(); });
    thread.join();
  }

  lws_context* open_context() {
    static const lws_protocols kNames[] = {{kProtocols[0].data(), on_event, 0, 0, 0, nullptr, kSendBufferBytes},
                                           {kProtocols[1].data(), on_event, 0, 0, 0, nullptr, kSendBufferBytes},
                                           {}};
    static const lws_retry_bo_t kIdle{nullptr, 0, 0, 10, 20, 0};  // s to a ping, and to the end without its answer
    lws_set_log_level(0, nullptr);                                // its log mentions each wrong client
    lws_context_creation_info info{};
    info.port = CONTEXT_PORT_NO_LISTEN_SERVER;
    info.protocols = kNames;
    info.options = LWS_SERVER_OPTION_VALIDATE_UTF8;
    info.fd_limit_per_thread = kMostConnections + 8;
    info.max_http_header_data2 = kHeaderBytes;
    info.timeout_secs_ah_idle = kRequestTime_s;
    info.retry_and_idle_policy = &kIdle;
    info.user = this;
    return lws_create_context(&info);
  }

  /// There are events of this descriptor from now on. The library closes it.
  lws* adopt(int descriptor, lws_adoption_type type) {
    lws_sock_file_fd_type file{};
    file.filefd = descriptor;
    return lws_adopt_descriptor_vhost(lws_get_vhost_by_name(context.get(), "default"), type, file, nullptr, nullptr);
  }

  /// `user`: the session; null where the connection is new or is none. Less than 0 ends the connection.
  static int on_event(lws* connection, lws_callback_reasons event, void* user, void* bytes, std::size_t size) try {
    Parts& parts = *static_cast<Parts*>(lws_context_user(lws_get_context(connection)));
    auto* const session = static_cast<Session*>(user);
    switch (event) {
      case LWS_CALLBACK_EVENT_WAIT_CANCELLED:
        while (const auto task = parts.posted()) task();
        return 0;
      case LWS_CALLBACK_RAW_RX_FILE:
        connection == parts.timer ? parts.tick() : parts.accept();
        return 0;
      case LWS_CALLBACK_SERVER_NEW_CLIENT_INSTANTIATED:
        parts.sessions.push_back(std::make_unique<Session>(connection, ++parts.connections));
        lws_set_wsi_user(connection, parts.sessions.back().get());
        return 0;
      case LWS_CALLBACK_HTTP:
      case LWS_CALLBACK_HTTP_CONFIRM_UPGRADE:
        return session->answer_request(
            parts.config.token, parts.config.origins,
            std::ranges::count_if(parts.sessions, [](const auto& one) { return one->is_open(); }));
      case LWS_CALLBACK_ESTABLISHED:
        parts.opened(*session);
        return 0;
      case LWS_CALLBACK_RECEIVE:
        return session->read(bytes, size, [&](const Request& request) { parts.requested(*session, request); });
      case LWS_CALLBACK_SERVER_WRITEABLE:
        return session->write();
      case LWS_CALLBACK_WS_SERVER_DROP_PROTOCOL:
        session->closing();
        return 0;
      case LWS_CALLBACK_RAW_ADOPT:  // by the method CONNECT
        return -1;
      case LWS_CALLBACK_WSI_DESTROY:
        if (session != nullptr) parts.closed(*session);
        return 0;
      default:
        return 0;
    }
  } catch (const std::exception& fault) {
    fmt::print(stderr, "gui_headless: viewers: {}\n", fault.what());
    return user != nullptr ? -1 : 0;
  }

  /// Does this in the thread of the server.
  void post(std::function<void()> task) {
    const std::lock_guard lock(mutex);
    tasks.push_back(std::move(task));
    lws_cancel_service(context.get());
  }

  /// The next one; empty if there is none.
  std::function<void()> posted() {
    const std::lock_guard lock(mutex);
    if (tasks.empty()) return {};
    std::function<void()> task = std::move(tasks.front());
    tasks.pop_front();
    return task;
  }

  void accept() {
    const int socket = accept4(lws_get_socket_fd(listener), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    constexpr int kOn = 1;
    setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &kOn, sizeof kOn);
    setsockopt(socket, SOL_SOCKET, SO_SNDBUF, &kSendBufferBytes, sizeof kSendBufferBytes);
    setsockopt(socket, IPPROTO_TCP, TCP_NOTSENT_LOWAT, &kUnsentBytes, sizeof kUnsentBytes);
    if (socket < 0)  // as where no file is left to open
      lws_rx_flow_control(listener, 0);
    else if (!make_place())
      close(socket);
    else
      adopt(socket, static_cast<lws_adoption_type>(LWS_ADOPT_SOCKET | LWS_ADOPT_HTTP));
  }

  /// For a new connection: the oldest one that has not finished its request leaves.
  bool make_place() {
    const auto ended = [](const auto& one) { return one->is_closing(); };
    if (sessions.size() - std::ranges::count_if(sessions, ended) < kMostConnections) return true;
    const auto oldest = std::ranges::find_if(sessions, [&](const auto& one) { return !one->is_open() && !ended(one); });
    if (oldest == sessions.end()) return false;
    (*oldest)->reset();
    return true;
  }

  void schedule(std::chrono::nanoseconds period) {
    const itimerspec once{{}, {0, period.count()}};
    timerfd_settime(lws_get_socket_fd(timer), 0, &once, nullptr);
  }

  void tick() {
    const auto now = Session::Clock::now();
    done = leaving && now >= latest_end;
    if (leaving) return schedule(kLook);  // its time may have come just before the end of the run
    schedule(subscribers > 0 ? kPeriod : std::chrono::nanoseconds(kIdlePeriod));
    lws_rx_flow_control(listener, 1);
    if (subscribers > 0) sources.poll(deliver);
    if (now >= next_inspection) {
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
    latest_end = Session::Clock::now() + kFarewell;
    schedule(kLook);
  }

  void opened(Session& session) {
    session.open();
    session.send_control(server_info_text(fmt::format("Subworld: {}", config.name), session_id, session.number()));
    session.send_control(advertise_text(sources.channels()));
  }

  void requested(Session& session, const Request& request) {
    using Op = Request::Op;
    if (request.op == Op::refused) session.send_control(status_text(Level::error, request.why));
    for (const Request::Item& item : request.items) try {
        if (request.op == Op::subscribe) subscribe(session, item);
        if (request.op == Op::unsubscribe) unsubscribe(session, item.id);
        if (request.op == Op::advertise) advertise(session, item);
        if (request.op == Op::unadvertise) withdraw(session, item.id);
        if (request.op == Op::publish) publish(session, item.id, request.bytes);
      } catch (const std::exception& fault) {
        const bool reads = request.op == Op::subscribe || request.op == Op::unsubscribe;
        session.send_control(status_text(
            Level::error, fmt::format("{} {}: {}", reads ? "subscription" : "channel", item.id, fault.what())));
      }
  }

  // These throw `std::exception` where they refuse.
  static void require(bool holds, const std::string& else_why) {
    if (!holds) throw std::runtime_error(else_why);
  }
  void advertise(Session& session, const Request::Item& offered) {
    const std::optional<int> user = tools.user_of(offered.topic);
    require((offered.topic == kOrderTopic || user) && offered.encoding == "cdr",
            fmt::format("this server takes messages of {} and of /user_N/tool in cdr only", kOrderTopic));
    require(session.may_publish(),
            "a page of another site may not give orders or hold tools; start the display with a token, and give it");
    require(session.publications.size() < kMostSubscriptions, "too many channels");
    session.publications[offered.id] = user;
  }

  void publish(Session& session, std::uint32_t id, std::span<const std::uint8_t> bytes) {
    const auto known = session.publications.find(id);
    require(known != session.publications.end(), "is not advertised");
    const std::optional<int> user = known->second;
    if (user && over) return;
    const auto now = Session::Clock::now();
    const std::string fault = user ? tools.move(*user, session.number(), bytes, now) : orders.send(bytes, now);
    show_tools();
    require(fault.empty(), fault);
  }

  void withdraw(Session& session, std::uint32_t id) {
    const auto known = session.publications.find(id);
    if (known == session.publications.end()) return;
    if (known->second) tools.release(*known->second, session.number());
    session.publications.erase(known);
    show_tools();
  }

  void show_tools() { sources.show(kToolsTopic, tools.state(), deliver); }

  void subscribe(Session& session, const Request::Item& wanted) {
    const Channel* channel = sources.channel(wanted.channel);
    require(channel != nullptr, fmt::format("there is no channel {}", wanted.channel));
    require(!session.subscriptions.contains(wanted.id), "this id is in use");
    require(session.subscriptions.size() < kMostSubscriptions, "too many subscriptions");
    sources.subscribe(*channel);
    session.subscriptions[wanted.id] = wanted.channel;
    if (subscribers++ == 0) schedule(kPeriod);
    for (const Sample& sample : sources.newest(*channel)) session.send_data(wanted.id, sample);
  }

  void unsubscribe(Session& session, std::uint32_t id) {
    const auto known = session.subscriptions.find(id);
    require(known != session.subscriptions.end(), "there is none");
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
  const std::string session_id = fmt::format("{:08x}{:08x}", std::random_device()(), std::random_device()());
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
  Session::Clock::time_point latest_end;
  std::vector<std::unique_ptr<Session>> sessions;
  const Sources::Deliver deliver = [this](const Channel& channel, const Sample& sample) {
    for (const auto& session : sessions)
      for (const auto& [id, subscribed] : session->subscriptions)
        if (subscribed == channel.id) session->send_data(id, sample);
  };

  std::mutex mutex;
  std::deque<std::function<void()>> tasks;
  std::unique_ptr<lws_context, decltype(&lws_context_destroy)> context{nullptr,
                                                                       &lws_context_destroy};  // of the sessions
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

void Server::show_verdict(const std::string& summary_file) {
  parts_->post([parts = parts_.get(), summary_file] {
    parts->sources.show(kVerdictTopic, encode_verdict(summary_file), parts->deliver);
  });
}

const std::string& Server::address() const noexcept { return parts_->address; }

}  // namespace subworld::live
