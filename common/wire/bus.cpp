#include "wire/bus.hpp"

#include "model/joined.hpp"
#include "wire/backend.hpp"
#include "wire/codec/codec.hpp"
#include "wire/event_text.hpp"
#include "wire/message_memory.hpp"
#include "wire/observer.hpp"
#include "wire/plugin.hpp"
#include "wire/test_delay.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

namespace subworld {
namespace {

/// Counts the events that the vendor's threads and the readers report, and wakes the waiting thread.
class Events final : public wire::EventSink {
 public:
  void report(wire::Event event, std::uint64_t count, const char* side, const char* topic,
              const char* detail) noexcept override {
    // Each user's topics have their own partition, so that one user's writer and another's reader never match.
    if (event == wire::Event::incompatible_qos && std::string_view(detail) == wire::policy_name(wire::kPartitionPolicy))
      return;
    const auto kind = static_cast<std::size_t>(event);
    {
      const std::lock_guard lock(mutex_);
      counts_[kind] += count;
      note(event, side, topic, detail);
    }
    wake();
  }

  void wake() noexcept override {
    {
      const std::lock_guard lock(mutex_);
      ++changes_;
    }
    changed_.notify_one();
  }

  bool wait(double timeout_s) noexcept {
    std::unique_lock lock(mutex_);
    const bool woken =
        changed_.wait_for(lock, std::chrono::duration<double>(timeout_s), [this] { return changes_ != seen_; });
    seen_ = changes_;
    return woken;
  }

  [[nodiscard]] EventCounts counts() const noexcept {
    const std::lock_guard lock(mutex_);
    return {counts_[0], counts_[1], counts_[2], counts_[3], counts_[4], counts_[5], counts_[6], counts_[7]};
  }

  std::string take_text(EventKind kind) {
    std::array<Noted, kMostNotes> taken;  // formatted without the lock, for which a vendor's thread may wait
    std::size_t count = 0;
    {
      const std::lock_guard lock(mutex_);
      for (std::size_t i = 0; i < noted_; ++i) {
        if (!notes_[i].waiting || wire::kind_of(notes_[i].event) != kind) continue;
        notes_[i].waiting = false;
        notes_[i].said = true;
        taken[count++] = notes_[i];
      }
    }
    std::string text;
    for (std::size_t i = 0; i < count; ++i) {
      const std::string more = wire::explain(taken[i].event, taken[i].side, taken[i].topic, taken[i].detail);
      if (!text.empty() && !more.empty()) text += "; ";
      text += more;
    }
    return text;
  }

  void forget(EventKind kind) noexcept {
    const std::lock_guard lock(mutex_);
    for (std::size_t i = 0; i < noted_; ++i) notes_[i].waiting &= wire::kind_of(notes_[i].event) != kind;
  }

 private:
  static constexpr std::size_t kMostNotes = 64;

  /// An event of one endpoint, whose strings live as long as the program.
  struct Noted {
    wire::Event event{};
    const char* side = "";
    const char* topic = "";
    const char* detail = "";
    bool waiting = false;
    bool said = false;
  };

  void note(wire::Event event, const char* side, const char* topic, const char* detail) noexcept {
    if (event == wire::Event::matched || event == wire::Event::unmatched) return;
    const auto end = notes_.begin() + static_cast<std::ptrdiff_t>(noted_);
    const auto same = std::find_if(notes_.begin(), end, [&](const Noted& one) {
      return one.event == event && std::string_view(one.side) == side && std::string_view(one.topic) == topic;
    });
    if (same != end) {
      same->waiting = !same->said;
    } else if (noted_ < notes_.size()) {
      notes_[noted_++] = {event, side, topic, detail, true, false};
    }
  }

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::uint64_t changes_ = 0;
  std::uint64_t seen_ = 0;
  std::array<std::uint64_t, 8> counts_{};
  std::array<Noted, kMostNotes> notes_{};
  std::size_t noted_ = 0;
};

}  // namespace

struct Bus::Impl {
  BusConfig config;
  std::string settings;
  Events events;
  std::unique_ptr<wire::Backend> backend;  // declared after events: its threads report until it is destroyed

  [[nodiscard]] wire::EndpointSpec spec(std::size_t topic, const std::string& partition,
                                        std::optional<double> shared_period_s = {},
                                        std::optional<Mode> quality = {}) const {
    test_delay();
    const TopicSpec& of = shared_period_s ? kSharedDeviceState : kTopics[topic];
    const double period_s = shared_period_s.value_or(config.device_period_s);
    wire::EndpointSpec spec{of, qos_of(of, quality.value_or(config.mode), period_s, config.cycle_s), partition};
    spec.qos.repeat_s *= thinning(config.users);
    if (config.mode == Mode::realtime && config.delay.any() && of.delayed)
      spec.transit = {Journey(config.delay, user_of_partition(partition)), *of.delayed,
                      of.reliability == Reliability::reliable};
    return spec;
  }
};

struct AnyWriter::Impl {
  std::unique_ptr<wire::BackendWriter> backend;
  std::unique_ptr<AnyCodec> codec;
  std::uint8_t topic;
  std::uint16_t user;
  bool kept;
  std::uint32_t number = 0;
  std::uint64_t bytes = 0;
};

AnyWriter::AnyWriter(const Bus& bus, std::size_t topic, const std::string& partition,
                     std::optional<double> shared_period_s, std::optional<Mode> quality)
    : impl_(new Impl{bus.impl_->backend->create_writer(bus.impl_->spec(topic, partition, shared_period_s, quality)),
                     make_codec(topic), static_cast<std::uint8_t>(topic), user_of_partition(partition),
                     !shared_period_s}) {}
AnyWriter::AnyWriter(AnyWriter&&) noexcept = default;
AnyWriter& AnyWriter::operator=(AnyWriter&&) noexcept = default;
AnyWriter::~AnyWriter() = default;

bool AnyWriter::write_any(const void* sample) noexcept {
  test_delay();
  const auto cdr = impl_->codec->encode(sample);
  if (cdr.empty() || !impl_->backend->write(cdr)) return false;
  if (impl_->kept)
    keep_message({.number = impl_->number++, .user = impl_->user, .topic = impl_->topic, .sent = true}, sample, cdr);
  impl_->bytes += cdr.size();
  return true;
}

int AnyWriter::matched() const noexcept { return impl_->backend->matched(); }
bool AnyWriter::wait_for_acknowledgments(double timeout_s) noexcept {
  return impl_->backend->wait_for_acknowledgments(timeout_s);
}
std::uint64_t AnyWriter::sent_bytes() const noexcept { return impl_->bytes; }

struct AnyReader::Impl {
  std::unique_ptr<wire::BackendReader> backend;
  std::unique_ptr<AnyCodec> codec;
  Events& events;
  std::uint8_t topic;
  std::vector<std::uint8_t> cdr = {};
  std::uint64_t bytes = 0;
  std::uint64_t writer = 0;  // writer of the last received sample
  std::uint32_t number = 0;
};

AnyReader::AnyReader(const Bus& bus, std::size_t topic, const std::string& partition,
                     std::optional<double> shared_period_s)
    : impl_(new Impl{bus.impl_->backend->create_reader(bus.impl_->spec(topic, partition, shared_period_s)),
                     make_codec(topic), bus.impl_->events, static_cast<std::uint8_t>(topic)}) {
  impl_->cdr.reserve(wire::kMessageBytes);
}
AnyReader::AnyReader(AnyReader&&) noexcept = default;
AnyReader& AnyReader::operator=(AnyReader&&) noexcept = default;
AnyReader::~AnyReader() = default;

bool AnyReader::receive() noexcept {
  test_delay();
  if (!impl_->backend->take(impl_->cdr, impl_->writer)) return false;
  impl_->bytes += impl_->cdr.size();
  return true;
}

bool AnyReader::decode_any(void* sample) noexcept {
  const Decoded decoded = impl_->codec->decode(impl_->cdr, sample);
  const char* const topic = kTopics[impl_->topic].name;
  if (decoded == Decoded::lacks_base) impl_->events.report(wire::Event::lost, 1, "reader", topic, "");
  if (decoded == Decoded::invalid)
    impl_->events.report(wire::Event::rejected, 1, "reader", topic, "corrupt or invalid");
  if (decoded == Decoded::sample) keep_message({.number = impl_->number++, .topic = impl_->topic}, sample, impl_->cdr);
  return decoded == Decoded::sample;
}

std::string to_text(const PeerProgram& program) {
  return fmt::format("{}{}{}", program.name.empty() ? "a program" : program.name,
                     program.process.empty() ? "" : ", process " + program.process,
                     program.host.empty() ? "" : " on " + program.host);
}

void AnyReader::trust_sender() noexcept { impl_->backend->trust(impl_->writer); }
void AnyReader::distrust() noexcept { impl_->backend->distrust(); }
std::uint64_t AnyReader::refused() const noexcept { return impl_->backend->refused(); }
std::uint64_t AnyReader::sender_participant() const noexcept { return impl_->backend->participant_of(impl_->writer); }
std::string AnyReader::foreign_programs() const {
  std::set<std::string> programs;
  for (const std::uint64_t writer : impl_->backend->foreign_writers())
    if (const auto program = impl_->backend->program_of(writer)) programs.insert(to_text(*program));
  return joined(programs, "; ");
}
std::optional<PeerProgram> AnyReader::sender_program() const { return impl_->backend->program_of(impl_->writer); }
int AnyReader::matched() const noexcept { return impl_->backend->matched(); }
int AnyReader::alive_writers() const noexcept { return impl_->backend->alive_writers(); }
std::uint64_t AnyReader::received_bytes() const noexcept { return impl_->bytes; }

std::unique_ptr<wire::BackendReader> Observer::reader(const Bus& bus, std::size_t topic, const std::string& partition) {
  static class Unheard final : public wire::EventSink {
    void report(wire::Event, std::uint64_t, const char*, const char*, const char*) noexcept override {}
    void wake() noexcept override {}
  } unheard;
  wire::EndpointSpec spec = bus.impl_->spec(topic, partition);
  spec.qos = {.depth = kNewestOfSeveral, .lease_s = kLongLease_s};  // matches the writers of both modes
  spec.events = &unheard;
  spec.transit.reset();
  return bus.impl_->backend->create_reader(spec);
}

std::unique_ptr<wire::BackendWriter> Observer::counterpart(const Bus& bus, std::size_t topic,
                                                           const std::string& partition) {
  wire::EndpointSpec spec = bus.impl_->spec(topic, partition);
  spec.qos.reliable = spec.qos.transient_local = true;
  spec.qos.keep_all = false;
  spec.qos.depth = std::max(spec.topic.depth, kNewestOfSeveral);
  spec.qos.max_blocking_s = 0.0;
  return bus.impl_->backend->create_writer(spec);
}

Bus::Bus(const BusConfig& config) : impl_(std::make_unique<Impl>()) {
  test_delay(kTestDelayOfStart);
  open_messages();
  impl_->config = config;
  const wire::Opening opening = wire::prepare(config);
  impl_->backend.reset(wire::load_plugin(config.vendor)(opening, impl_->events));
  impl_->settings = fmt::format("dds={} {} {} domain={} mode={} settings={}{}", name_of(config.vendor),
                                wire::installed_version(config.vendor), impl_->backend->route(), config.domain,
                                config.mode == Mode::lockstep ? "lockstep" : "realtime", opening.settings_source,
                                opening.keys ? " secure=" + config.secure : "");
}

Bus::~Bus() = default;

bool Bus::wait(double timeout_s) noexcept { return impl_->events.wait(timeout_s); }
EventCounts Bus::events() const noexcept { return impl_->events.counts(); }
std::string Bus::take_event_text(EventKind kind) { return impl_->events.take_text(kind); }
void Bus::forget_absences() noexcept { impl_->events.forget(EventKind::absence); }
const std::string& Bus::effective_settings() const noexcept { return impl_->settings; }

double shared_period_s(const Settings& settings, double rate_hz) noexcept {
  return settings.sample_period_s(std::min(rate_hz, 1.0 / kShared_s));
}

std::unique_ptr<Bus> open_bus(const BusConfig& config) { return std::make_unique<Bus>(config); }

void check_keys(const std::string& folder, const std::string& program) { (void)wire::keys_of(folder, program); }

void check_network(const Network& network) {
  (void)wire::prepare({.vendor = parse_vendor(network.dds),
                       .domain = network.domain,
                       .peers = network.peers,
                       .interface_address = network.interface_address,
                       .qos_file = network.qos_file});
}

namespace {

/// Those of the run, and some that are not of it. A program that does not know the run searches for all. Each is sent
/// to every host by every program: where the users of a host are known, none is searched for in vain.
int searched_participants(const Network& network, int users) {
  const int room = participant_room(network.domain);
  if (users == 0) return room;
  if (network.host_users > 0) return std::min(participants_of(std::min(users, network.host_users)), room);
  constexpr int kUsual = 32;
  return std::clamp(participants_of(users), std::min(kUsual, room), room);
}

}  // namespace

std::unique_ptr<Bus> open_bus(const Network& network, const Settings& settings, double device_period_s,
                              const std::string& participant_name) {
  return open_bus({.vendor = parse_vendor(network.dds),
                   .domain = network.domain,
                   .mode = settings.mode,
                   .peers = network.peers,
                   .interface_address = network.interface_address,
                   .qos_file = network.qos_file,
                   .secure = network.secure,
                   .device_period_s = device_period_s,
                   .cycle_s = settings.longest_cycle_s(),
                   .delay = settings.delay,
                   .users = settings.users,
                   .participants = searched_participants(network, settings.users),
                   .participant_name = participant_name});
}

}  // namespace subworld
