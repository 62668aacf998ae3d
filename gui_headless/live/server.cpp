#include "server.hpp"

#include "model/error.hpp"
#include "orders.hpp"
#include "session.hpp"
#include "sources.hpp"
#include "tools.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>

#include <algorithm>
#include <charconv>
#include <future>
#include <random>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

namespace subworld::live {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;

constexpr std::size_t kMostClients = 32, kMostConnections = 64, kMostSubscriptions = 1024;
constexpr std::chrono::nanoseconds kPeriod{1'000'000'000 / 60};  // the highest rate of a channel
constexpr std::chrono::milliseconds kIdlePeriod{250}, kInspection{500}, kFarewell{500}, kRetry{100};

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

tcp::acceptor open_acceptor(asio::io_context& io, const ServerConfig& config) {
  boost::system::error_code fault;
  const auto address = asio::ip::make_address(config.address, fault);
  tcp::acceptor acceptor(io);
  const tcp::endpoint endpoint(address, static_cast<std::uint16_t>(config.port));
  if (!fault) acceptor.open(endpoint.protocol(), fault);
  if (!fault) acceptor.set_option(asio::socket_base::reuse_address(true), fault);
  if (!fault) acceptor.bind(endpoint, fault);
  if (!fault) acceptor.listen(asio::socket_base::max_listen_connections, fault);
  if (fault) {
    throw Error(ExitCode::failed,
                fmt::format("cannot serve viewers on {} port {}: {}; choose another --live PORT or --listen ADDRESS",
                            config.address, config.port, fault.message()));
  }
  return acceptor;
}

}  // namespace

struct Server::Parts final : Host {
  Parts(const ServerConfig& wanted, Bus& bus)
      : config(wanted),
        sources(bus, wanted.users),
        orders(bus),
        tools(wanted.domain, wanted.users),
        acceptor(open_acceptor(io, wanted)),
        accept_again(io),
        tick(io),
        farewell(io) {
    const tcp::endpoint own = acceptor.local_endpoint();
    const std::string host = own.address().to_string();
    address = fmt::format("{}:{}", own.address().is_v6() ? "[" + host + "]" : host, own.port());
    accept();
    schedule(kIdlePeriod);
    // Signals go to the main thread.
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    thread = std::thread([this] { work(); });
    pthread_sigmask(SIG_SETMASK, &before, nullptr);
  }

  ~Parts() override {
    asio::post(io, [this] { leave(); });
    thread.join();
  }

  void work() noexcept {
    for (;;) {
      try {
        io.run();
        return;
      } catch (const std::exception& fault) {
        fmt::print(stderr, "gui_headless: viewers: {}\n", fault.what());
      }
    }
  }

  void accept() {
    acceptor.async_accept([this](boost::system::error_code fault, tcp::socket socket) {
      if (leaving) return;
      if (fault) {  // as where no file is left to open
        accept_again.expires_after(kRetry);
        return accept_again.async_wait([this](boost::system::error_code) {
          if (!leaving) accept();
        });
      }
      accept();
      if (sessions.size() >= kMostConnections) return;
      sessions.push_back(std::make_shared<Session>(std::move(socket), *this, ++connections));
      sessions.back()->start();
    });
  }

  void schedule(std::chrono::nanoseconds period) {
    tick.expires_after(period);
    tick.async_wait([this](boost::system::error_code fault) {
      if (fault || leaving) return;
      schedule(subscribers > 0 ? kPeriod : std::chrono::nanoseconds(kIdlePeriod));
      if (subscribers > 0) sources.poll(deliver);
      if (const auto now = Session::Clock::now(); now >= next_inspection) {
        next_inspection = now + kInspection;
        orders.inspect(now);
        tools.inspect(now);
        show_tools();
        for (const auto& session : std::vector(sessions)) session->inspect(now);
      }
    });
  }

  void leave() {
    leaving = true;
    boost::system::error_code ignored;
    acceptor.close(ignored);
    tick.cancel();
    accept_again.cancel();
    for (const auto& session : std::vector(sessions))
      session->close(websocket::close_code::going_away, "the run ended");
    farewell.expires_after(sessions.empty() ? std::chrono::milliseconds(0) : kFarewell);
    farewell.async_wait([this](boost::system::error_code) { io.stop(); });
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
    if (subscribers++ == 0) tick.cancel(), schedule(kPeriod);
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

  void closed(Session& session) override {
    for (const auto& [id, channel] : session.subscriptions) {
      sources.unsubscribe(*sources.channel(channel));
      --subscribers;
    }
    session.subscriptions.clear();
    if (!leaving) tools.release(session.number());  // the end of the run is no absence of a device
    show_tools();
    std::erase_if(sessions, [&](const auto& one) { return one.get() == &session; });
    if (leaving && sessions.empty()) io.stop();
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
  Session::Clock::time_point next_inspection;
  asio::io_context io{1};
  std::vector<std::shared_ptr<Session>> sessions;
  tcp::acceptor acceptor;
  asio::steady_timer accept_again, tick, farewell;
  std::thread thread;
  const Sources::Deliver deliver = [this](const Channel& channel, const Sample& sample) {
    for (const auto& session : sessions)
      for (const auto& [id, subscribed] : session->subscriptions)
        if (subscribed == channel.id) session->send_data(id, sample);
  };
};

Server::Server(const ServerConfig& config, Bus& bus) : parts_(std::make_unique<Parts>(config, bus)) {}
Server::~Server() = default;

void Server::describe(const SceneDescription& scene) {
  asio::post(parts_->io, [parts = parts_.get(), copy = std::make_shared<const SceneDescription>(scene)] {
    parts->sources.describe(copy, parts->deliver);
  });
}

void Server::place(ProgramKind program, std::uint32_t instance, const PeerProgram& peer) {
  asio::post(parts_->io, [parts = parts_.get(), program, instance, peer] {
    parts->sources.place(program, instance, peer, parts->deliver);
  });
}

void Server::end_run() {
  asio::post(parts_->io, [parts = parts_.get()] { parts->over = true; });
}

bool Server::verdict_is_awaited() const {
  std::promise<bool> answer;
  asio::post(parts_->io, [&] { answer.set_value(parts_->sources.verdict_is_awaited()); });
  return answer.get_future().get();
}

void Server::show_verdict(std::vector<std::uint8_t> cdr) {
  asio::post(parts_->io, [parts = parts_.get(), cdr = std::move(cdr)]() mutable {
    parts->sources.show(kVerdictTopic, std::move(cdr), parts->deliver);
  });
}

const std::string& Server::address() const noexcept { return parts_->address; }

}  // namespace subworld::live
