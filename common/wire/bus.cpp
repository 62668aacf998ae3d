#include "wire/bus.hpp"

#include "wire/backend.hpp"
#include "wire/codec.hpp"
#include "wire/plugin.hpp"

#include <fmt/format.h>

#include <array>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <utility>

namespace subworld {
namespace {

constexpr std::array kEventNames{"matched",          "unmatched",   "deadline missed", "liveliness lost",
                                 "incompatible QoS", "sample lost", "sample rejected"};

/// Counts what the vendor's threads and the readers report and wakes who waits.
class Events final : public wire::EventSink {
 public:
  void report(wire::Event event, std::uint64_t count, const char* side, const char* topic,
              const char* detail) noexcept override {
    const auto kind = static_cast<std::size_t>(event);
    {
      const std::lock_guard lock(mutex_);
      counts_[kind] += count;
      const auto end = fmt::format_to_n(text_.begin(), text_.size(), "{}: {} of {}{}{}", kEventNames[kind], side, topic,
                                        *detail == '\0' ? "" : ", ", detail);
      text_size_ = std::min(end.size, text_.size());
      ++changes_;
    }
    changed_.notify_one();
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
    return {counts_[0], counts_[1], counts_[2], counts_[3], counts_[4], counts_[5], counts_[6]};
  }

  std::string take_text() {
    const std::lock_guard lock(mutex_);
    return {text_.data(), std::exchange(text_size_, std::size_t{0})};
  }

 private:
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::uint64_t changes_ = 0;
  std::uint64_t seen_ = 0;
  std::array<std::uint64_t, kEventNames.size()> counts_{};
  std::array<char, 160> text_{};
  std::size_t text_size_ = 0;
};

}  // namespace

struct Bus::Impl {
  BusConfig config;
  std::string settings;
  Events events;
  std::unique_ptr<wire::Backend> backend;  // after events: its threads report until it is gone

  [[nodiscard]] wire::EndpointSpec spec(const TopicSpec& topic, const std::string& partition) const {
    return {topic, qos_of(topic, config.mode, config.device_period_s, config.cycle_s), partition};
  }
};

template <class M>
struct Writer<M>::Impl {
  std::unique_ptr<wire::BackendWriter> backend;
  Codec<M> codec;
  std::uint64_t bytes = 0;
};

template <class M>
struct Reader<M>::Impl {
  std::unique_ptr<wire::BackendReader> backend;
  Events* events = nullptr;
  Codec<M> codec;
  std::vector<std::uint8_t> cdr;
  std::uint64_t bytes = 0;
};

template <class M>
Writer<M>::Writer(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
template <class M>
Writer<M>::Writer(Writer&&) noexcept = default;
template <class M>
Writer<M>& Writer<M>::operator=(Writer&&) noexcept = default;
template <class M>
Writer<M>::~Writer() = default;

template <class M>
bool Writer<M>::write(const M& sample) noexcept {
  const auto cdr = impl_->codec.encode(sample);
  if (cdr.empty() || !impl_->backend->write(cdr)) return false;
  impl_->bytes += cdr.size();
  return true;
}

template <class M>
int Writer<M>::matched() const noexcept {
  return impl_->backend->matched();
}

template <class M>
bool Writer<M>::wait_for_acknowledgments(double timeout_s) noexcept {
  return impl_->backend->wait_for_acknowledgments(timeout_s);
}

template <class M>
std::uint64_t Writer<M>::sent_bytes() const noexcept {
  return impl_->bytes;
}

template <class M>
Reader<M>::Reader(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
template <class M>
Reader<M>::Reader(Reader&&) noexcept = default;
template <class M>
Reader<M>& Reader<M>::operator=(Reader&&) noexcept = default;
template <class M>
Reader<M>::~Reader() = default;

template <class M>
Take Reader<M>::take(M& sample) noexcept {
  if (!impl_->backend->take(impl_->cdr)) return Take::none;
  impl_->bytes += impl_->cdr.size();
  if (impl_->codec.decode(impl_->cdr, sample)) return Take::sample;
  impl_->events->report(wire::Event::rejected, 1, "reader", kTopicOf<M>->name, "corrupt or nonsense");
  return Take::rejected;
}

template <class M>
bool Reader<M>::take_latest(M& sample) noexcept {
  bool found = false;
  for (Take taken = take(sample); taken != Take::none; taken = take(sample)) found |= taken == Take::sample;
  return found;
}

template <class M>
int Reader<M>::matched() const noexcept {
  return impl_->backend->matched();
}

template <class M>
int Reader<M>::alive_writers() const noexcept {
  return impl_->backend->alive_writers();
}

template <class M>
std::uint64_t Reader<M>::received_bytes() const noexcept {
  return impl_->bytes;
}

Bus::Bus(const BusConfig& config) : impl_(std::make_unique<Impl>()) {
  impl_->config = config;
  const wire::Opening opening = wire::prepare(config);
  impl_->backend.reset(wire::load_plugin(config.vendor)(opening, impl_->events));
  impl_->settings = fmt::format(
      "dds={} {} domain={} mode={} settings={}", name_of(config.vendor), impl_->backend->describe(), config.domain,
      config.mode == Mode::lockstep ? "lockstep" : "realtime", wire::describe_source(config, opening));
}

Bus::~Bus() = default;

template <class M>
Writer<M> Bus::writer(const std::string& partition) {
  auto impl = std::make_unique<typename Writer<M>::Impl>();
  impl->backend = impl_->backend->create_writer(impl_->spec(*kTopicOf<M>, partition));
  return Writer<M>(std::move(impl));
}

template <class M>
Reader<M> Bus::reader(const std::string& partition) {
  auto impl = std::make_unique<typename Reader<M>::Impl>();
  impl->backend = impl_->backend->create_reader(impl_->spec(*kTopicOf<M>, partition));
  impl->events = &impl_->events;
  return Reader<M>(std::move(impl));
}

bool Bus::wait(double timeout_s) noexcept { return impl_->events.wait(timeout_s); }
EventCounts Bus::events() const noexcept { return impl_->events.counts(); }
std::string Bus::take_event_text() { return impl_->events.take_text(); }
const std::string& Bus::effective_settings() const noexcept { return impl_->settings; }

std::unique_ptr<Bus> open_bus(const BusConfig& config) { return std::make_unique<Bus>(config); }

#define SUBWORLD_TOPIC(M)                                \
  template class Writer<M>;                              \
  template class Reader<M>;                              \
  template Writer<M> Bus::writer<M>(const std::string&); \
  template Reader<M> Bus::reader<M>(const std::string&);

SUBWORLD_TOPIC(SceneDescription)
SUBWORLD_TOPIC(DeviceState)
SUBWORLD_TOPIC(DeviceCommand)
SUBWORLD_TOPIC(WorldFrame)
SUBWORLD_TOPIC(HapticReport)
SUBWORLD_TOPIC(WorldSnapshot)
SUBWORLD_TOPIC(Control)
SUBWORLD_TOPIC(Status)

std::unique_ptr<Bus> open_bus(const Network& network, const Settings& settings, double device_period_s,
                              const std::string& participant_name) {
  return open_bus({.vendor = parse_vendor(network.dds),
                   .domain = network.domain,
                   .mode = settings.mode,
                   .peers = network.peers,
                   .interface_address = network.interface_address,
                   .qos_file = network.qos_file,
                   .device_period_s = device_period_s,
                   .cycle_s = settings.cycle_s(),
                   .participant_name = participant_name});
}

}  // namespace subworld
