// Driver of a Haply Inverse3 by its service: JSON over a WebSocket, one state for each command
// (https://docs.haply.co/inverseSDK/service/realtime/websocket-protocol).
#include "device_sim/driver.hpp"
#include "device_sim/drivers/settings.hpp"

#include <libwebsockets.h>
#include <nlohmann/json.hpp>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace {

using namespace subworld;
using Json = nlohmann::json;
using Clock = std::chrono::steady_clock;

/// The members of an object as numbers; none where one is missing, or not finite.
template <std::size_t N>
std::optional<std::array<double, N>> numbers(const Json& of, const char* key, const std::array<const char*, N>& names) {
  const auto found = of.is_object() ? of.find(key) : of.end();
  if (!of.is_object() || found == of.end() || !found->is_object()) return {};
  std::array<double, N> values{};
  for (std::size_t i = 0; i < N; ++i) {
    const auto one = found->find(names[i]);
    if (one == found->end() || !one->is_number() || !std::isfinite(one->template get<double>())) return {};
    values[i] = one->template get<double>();
  }
  return values;
}
constexpr std::array kAxes{"x", "y", "z"};
constexpr std::array kQuaternion{"w", "x", "y", "z"};

/// The device of a kind with this identifier; null: none. Without an identifier, the one at a position.
const Json* find_device(const Json& message, const char* kind, const std::string& id, int position = 0) {
  const auto devices = message.is_object() ? message.find(kind) : message.end();
  if (!message.is_object() || devices == message.end() || !devices->is_array()) return nullptr;
  for (const Json& one : *devices) {
    if (!one.is_object()) continue;
    if (id.empty() ? position-- == 0 : one.value("device_id", "") == id) return &one;
  }
  return nullptr;
}

class HaplyDriver final : public DeviceDriver {
 public:
  ~HaplyDriver() override { close(); }

  DriverCapabilities open(const DriverRequest& request) override {
    DriverSettings settings(request.settings);
    address_ = settings.take("address", std::string("127.0.0.1"));
    port_ = static_cast<int>(settings.take("port", 10001.0));
    id_ = settings.take("device", std::string());
    DriverCapabilities capabilities{
        .degrees_of_freedom = 3,
        .workspace_m = settings.take("workspace_m", 0.5),
        .force_limit_n = settings.take("force_n", 8.0),
        .torque_limit_n_m = 0.0,
        .rate_hz = settings.take("rate_hz", 1000.0),
        .measures_velocity = true,
    };
    settings.check();
    if (port_ < 1 || port_ > 65535) throw std::invalid_argument("setting port: must be from 1 to 65535");
    connect();
    const Json inventory = wait_for_inventory();
    const Json* const device = find_device(inventory, "inverse3", id_, request.user);
    if (device == nullptr)
      throw std::runtime_error((id_.empty() ? "no Inverse3 for this user" : "no Inverse3 with device_id " + id_) +
                               " at the service of " + place() + "; the service knows " + known(inventory));
    id_ = device->value("device_id", "");
    has_handle_ = handle_of(inventory) != nullptr;
    take_state(inventory);  // the service sends the next one after a command
    if (has_handle_) capabilities.degrees_of_freedom = 6;
    return capabilities;
  }

  bool read(DriverReading& reading) override {
    serve();
    if (!fresh_) return false;
    reading = reading_;
    fresh_ = false;
    return true;
  }

  void write(const DriverWrench& wrench) override {
    std::array<char, 256> text{};
    const auto& force = wrench.force_n;
    // The session has a name once, for the service's own display.
    const int size = std::snprintf(text.data(), text.size(),
                                   R"({%s"inverse3":[{"device_id":"%s","commands":{"set_cursor_force":{"values":)"
                                   R"({"x":%.6g,"y":%.6g,"z":%.6g}}}}]})",
                                   named_ ? "" : R"("session":{"configure":{"profile":{"name":"subworld"}}},)",
                                   id_.c_str(), force[0], force[1], force[2]);
    if (size < 0 || static_cast<std::size_t>(size) >= text.size()) throw std::runtime_error("device_id is too long");
    named_ = true;
    command_.assign(text.data(), static_cast<std::size_t>(size));
    lws_callback_on_writable(socket_);
    serve();
  }

  void close() override { context_.reset(); }

 private:
  static constexpr std::size_t kMostBytes = 1U << 20U;  // of a message
  static constexpr std::chrono::seconds kConnect{2};

  [[nodiscard]] std::string place() const { return "ws://" + address_ + ":" + std::to_string(port_); }

  void connect() {
    static const lws_protocols kProtocols[] = {{"", answer, 0, 4096, 0, nullptr, 0},
                                               {nullptr, nullptr, 0, 0, 0, nullptr, 0}};
    lws_set_log_level(0, nullptr);
    lws_context_creation_info info{};
    info.port = CONTEXT_PORT_NO_LISTEN;
    info.protocols = kProtocols;
    info.user = this;
    context_.reset(lws_create_context(&info));
    if (!context_) throw std::runtime_error("no memory for a WebSocket");
    lws_client_connect_info to{};
    to.context = context_.get();
    to.address = to.host = to.origin = address_.c_str();
    to.port = port_;
    to.path = "/";
    to.pwsi = &socket_;
    lws_client_connect_via_info(&to);
    const auto end = Clock::now() + kConnect;
    while (!connected_) {
      if (Clock::now() > end) lost_ = "it does not answer";
      serve();
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  Json wait_for_inventory() {
    const auto end = Clock::now() + kConnect;
    while (inventory_.is_null()) {
      if (Clock::now() > end) lost_ = "it sends no list of devices";
      serve();
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return std::move(inventory_);
  }

  /// Sends and receives without waiting. Throws where the service is lost.
  void serve() {
    constexpr int kMostParts = 64;  // of what has arrived: a flood stops nothing
    has_received_ = true;
    for (int parts = 0; lost_.empty() && has_received_ && parts < kMostParts; ++parts) {
      has_received_ = false;
      lws_service(context_.get(), -1);
    }
    if (!lost_.empty())
      throw std::runtime_error("the Haply Inverse Service at " + place() + ": " + lost_ +
                               "; start it, or name another address or port");
  }

  [[nodiscard]] static std::string known(const Json& inventory) {
    std::string text;
    for (int i = 0; const Json* one = find_device(inventory, "inverse3", "", i); ++i)
      text += (i > 0 ? ", " : "") + one->value("device_id", "?");
    return text.empty() ? "none" : text;
  }

  [[nodiscard]] static const Json* handle_of(const Json& message) {
    const Json* const handle = find_device(message, "wireless_verse_grip", "");
    return handle != nullptr ? handle : find_device(message, "verse_grip", "");
  }

  /// What is not a complete state of this device is no reading: device_sim notices its absence.
  void take(const std::string& text) {
    const Json message = Json::parse(text, nullptr, false);
    if (!message.is_object() || message.find("inverse3") == message.end()) return;
    if (!is_open_) {
      is_open_ = true;
      inventory_ = message;
    } else {
      take_state(message);
    }
  }

  void take_state(const Json& message) {
    const Json* const device = find_device(message, "inverse3", id_);
    if (device == nullptr) {
      if (message.at("inverse3").empty()) lost_ = "device " + id_ + " is gone";
      return;
    }
    const auto state = device->find("state");
    if (state == device->end()) return;
    const auto position = numbers(*state, "cursor_position", kAxes),
               velocity = numbers(*state, "cursor_velocity", kAxes);
    if (!position || !velocity) return;
    DriverReading next{.time_s = std::chrono::duration<double>(Clock::now().time_since_epoch()).count(),
                       .position_m = *position,
                       .orientation = reading_.orientation,
                       .linear_velocity_m_s = *velocity,
                       .buttons = reading_.buttons};
    if (has_handle_) take_handle(message, next);
    reading_ = next;
    fresh_ = true;
  }

  static void take_handle(const Json& message, DriverReading& reading) {
    const Json* const handle = handle_of(message);
    const auto state = handle != nullptr ? handle->find("state") : Json::const_iterator{};
    if (handle == nullptr || state == handle->end()) return;
    if (auto q = numbers(*state, "orientation", kQuaternion)) {
      const double length = std::hypot(std::hypot((*q)[0], (*q)[1]), std::hypot((*q)[2], (*q)[3]));
      constexpr double kTolerance = 0.05;
      if (std::abs(length - 1.0) < kTolerance) {
        for (double& one : *q) one /= length;
        reading.orientation = *q;
      }
    }
    const auto buttons = state->find("buttons");
    if (buttons == state->end() || !buttons->is_object()) return;
    reading.buttons = 0;
    std::uint32_t bit = 1;
    for (const char* name : {"a", "b", "c"}) {
      const auto pressed = buttons->find(name);
      if (pressed != buttons->end() && pressed->is_boolean() && pressed->get<bool>()) reading.buttons |= bit;
      bit <<= 1U;
    }
  }

  int receive(lws* socket, const void* data, std::size_t size) {
    has_received_ = true;
    received_.append(static_cast<const char*>(data), size);
    if (received_.size() > kMostBytes) {
      lost_ = "it sends a message of more than 1 MiB";
      return -1;
    }
    if (lws_remaining_packet_payload(socket) > 0 || lws_is_final_fragment(socket) == 0) return 0;
    take(received_);
    received_.clear();
    return 0;
  }

  int send(lws* socket) {
    if (command_.empty()) return 0;
    buffer_.resize(LWS_PRE + command_.size());
    std::memcpy(&buffer_[LWS_PRE], command_.data(), command_.size());
    const int sent = lws_write(socket, &buffer_[LWS_PRE], command_.size(), LWS_WRITE_TEXT);
    command_.clear();
    return sent < 0 ? -1 : 0;
  }

  static int answer(lws* socket, lws_callback_reasons reason, void*, void* data, std::size_t size) {
    lws_context* const context = socket != nullptr ? lws_get_context(socket) : nullptr;
    auto* const self = context != nullptr ? static_cast<HaplyDriver*>(lws_context_user(context)) : nullptr;
    if (self == nullptr) return 0;
    try {
      if (reason == LWS_CALLBACK_CLIENT_ESTABLISHED) self->connected_ = true;
      if (reason == LWS_CALLBACK_CLIENT_CONNECTION_ERROR)
        self->lost_ = data != nullptr ? std::string(static_cast<const char*>(data), size) : "no connection";
      if (reason == LWS_CALLBACK_CLIENT_CLOSED) self->lost_ = "it closed the connection";
      if (reason == LWS_CALLBACK_CLIENT_RECEIVE) return self->receive(socket, data, size);
      if (reason == LWS_CALLBACK_CLIENT_WRITEABLE) return self->send(socket);
    } catch (const std::exception& wrong) {
      self->lost_ = wrong.what();
      return -1;
    }
    return 0;
  }

  struct Destroy {
    void operator()(lws_context* context) const { lws_context_destroy(context); }
  };
  std::unique_ptr<lws_context, Destroy> context_;
  lws* socket_ = nullptr;
  std::string address_, id_, lost_, received_, command_;
  std::vector<unsigned char> buffer_;
  int port_ = 0;
  Json inventory_;
  DriverReading reading_;
  bool connected_ = false, named_ = false, has_handle_ = false, is_open_ = false, has_received_ = false, fresh_ = false;
};

constexpr DriverPlugin kPlugin{
    .name = "haply",
    .version = "1",
    .settings = "address=127.0.0.1 port=10001 device=(the first for user 0 ...) workspace_m=0.5 force_n=8 rate_hz=1000",
    .make = [] { return std::unique_ptr<DeviceDriver>(std::make_unique<HaplyDriver>()); }};

}  // namespace

SUBWORLD_DRIVER_PLUGIN(kPlugin)
