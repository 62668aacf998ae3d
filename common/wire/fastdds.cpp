// The Fast DDS back end, for 2.9.

#include "model/error.hpp"
#include "model/hash.hpp"
#include "wire/backend.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sched.h>
#include <sys/socket.h>
#include <unistd.h>

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/attributes/LibrarySettingsAttributes.h>
#include <fastrtps/config.h>
#include <fastrtps/utils/IPLocator.h>
#include <fastrtps/xmlparser/XMLProfileManager.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/ContentFilteredTopic.hpp>
#include <fastdds/dds/topic/IContentFilter.hpp>
#include <fastdds/dds/topic/IContentFilterFactory.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <filesystem>
#include <map>
#include <mutex>
#include <set>
#include <utility>

namespace subworld::wire {
namespace {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;
using eprosima::fastdds::rtps::UDPv4TransportDescriptor;
using eprosima::fastrtps::Duration_t;
using eprosima::fastrtps::types::ReturnCode_t;

constexpr const char* kProfile = "subworld";
constexpr std::uint32_t kFirstBytes = 512;  // of a history entry; grows with its samples
constexpr int kMostKeys = 256;              // as many as `is_known_key` accepts
// Fast DDS 2.9 may abort where a lease is checked while its participant leaves: run ends must not coincide with checks.
// The programs notice a death by the missing status.
constexpr double kLease_s = 100.0;
constexpr int kMostKept = 1024;  // acknowledged samples that a keep-all writer stores

[[noreturn]] void fail(const std::string& message) { throw Error(ExitCode::middleware, "Fast DDS: " + message); }

template <class Entity>
Entity* require(Entity* entity, const std::string& what) {
  if (entity == nullptr) fail(fmt::format("no {}; see its log lines above", what));
  return entity;
}

Duration_t duration(double seconds) {
  const double whole = std::floor(seconds);
  return {static_cast<std::int32_t>(whole), static_cast<std::uint32_t>((seconds - whole) * 1e9)};
}

/// Argument of the data type in the middleware's calls: the sender's bytes, or a buffer for received ones.
struct Sample {
  std::span<const std::uint8_t> sent;
  std::vector<std::uint8_t> received;
};

/// One type for every topic: it copies bytes. The key comes first in them.
class BytesType final : public dds::TopicDataType {
 public:
  explicit BytesType(const TopicSpec& topic) : key_words_(topic.key_words) {
    setName(topic.type);
    m_typeSize = kFirstBytes;
    m_isGetKeyDefined = key_words_ > 0;
    auto_fill_type_information(false);
    auto_fill_type_object(false);
  }

  bool serialize(void* data, rtps::SerializedPayload_t* payload) override {
    const auto bytes = static_cast<Sample*>(data)->sent;
    if (bytes.size() > payload->max_size) return false;
    std::memcpy(payload->data, bytes.data(), bytes.size());
    payload->length = static_cast<std::uint32_t>(bytes.size());
    payload->encapsulation = CDR_LE;
    return true;
  }

  bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
    static_cast<Sample*>(data)->received.assign(payload->data, payload->data + payload->length);
    return true;
  }

  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<std::uint32_t>(static_cast<Sample*>(data)->sent.size()); };
  }

  void* createData() override { return new Sample; }
  void deleteData(void* data) override { delete static_cast<Sample*>(data); }

  bool getKey(void* data, rtps::InstanceHandle_t* handle, bool) override {
    const auto* sample = static_cast<const Sample*>(data);
    const std::span<const std::uint8_t> bytes = sample->sent.empty() ? sample->received : sample->sent;
    if (key_words_ == 0) return false;
    // A reader of Fast DDS 2.9 ends its process for a sample without a key. Too short ones get zeros; the codec rejects
    // them.
    const bool complete = bytes.size() >= kHeaderBytes + 4 * key_words_;
    const bool little = complete && (bytes[1] & 1) != 0;
    for (std::uint32_t i = 0; i < 16; ++i) {
      const std::uint32_t from = little ? (i ^ 3U) : i;  // a key is big-endian
      handle->value[i] = complete && i < 4 * key_words_ ? bytes[kHeaderBytes + from] : std::uint8_t{0};
    }
    return true;
  }

 private:
  std::uint32_t key_words_;
};

/// Removes a listener. Fast DDS 2.9 looks up which listener handles a missed deadline, and then uses the endpoint's
/// own. If that is removed in between, the process crashes. Therefore a listener stays set, with an empty mask.
template <class Listener, class Endpoint>
void stop_listening(Endpoint& endpoint) {
  static Listener none;
  endpoint.set_listener(&none, dds::StatusMask::none());
}

class FastWriter final : public BackendWriter, dds::DataWriterListener {
 public:
  FastWriter(dds::DomainParticipant* participant, dds::Publisher* publisher, dds::Topic* topic,
             const EndpointSpec& spec, const dds::DataWriterQos& qos, EventSink& events)
      : BackendWriter(spec.topic.name, events),
        participant_(participant),
        publisher_(publisher),
        keeps_all_(spec.qos.keep_all) {
    writer_ = require(publisher->create_datawriter(topic, qos, this, dds::StatusMask::all()),
                      fmt::format("writer of {}", spec.topic.name));
  }

  ~FastWriter() override {
    stop_listening<dds::DataWriterListener>(*writer_);
    // Fast DDS 2.9 clears a history while its heartbeats still read it, and may then count its samples as missing
    // forever.
    std::size_t removed = 0;
    writer_->clear_history(&removed);
    publisher_->delete_datawriter(writer_);
    participant_->delete_publisher(publisher_);
  }

  bool write(std::span<const std::uint8_t> cdr) noexcept override {
    sample_.sent = cdr;
    try {
      if (keeps_all_ && ++kept_ >= kMostKept) forget();
      return writer_->write(&sample_);
    } catch (const std::exception&) {
      return false;
    }
  }

  bool wait_for_acknowledgments(double timeout_s) noexcept override {
    return writer_->wait_for_acknowledgments(duration(timeout_s)) == ReturnCode_t::RETCODE_OK;
  }

 private:
  /// Without this, a history that stores all samples for late readers would grow without bound.
  void forget() {
    std::size_t removed = 0;
    if (writer_->wait_for_acknowledgments(duration(0.0)) != ReturnCode_t::RETCODE_OK) return;
    writer_->clear_history(&removed);
    kept_ = 0;
  }

  void on_publication_matched(dds::DataWriter*, const dds::PublicationMatchedStatus& status) override { match(status); }
  void on_offered_deadline_missed(dds::DataWriter*, const dds::OfferedDeadlineMissedStatus& status) override {
    miss_deadline(status);
  }
  void on_offered_incompatible_qos(dds::DataWriter*, const dds::OfferedIncompatibleQosStatus& status) override {
    differ(status);
  }

  dds::DomainParticipant* participant_;
  dds::Publisher* publisher_;
  bool keeps_all_;
  int kept_ = 0;
  Sample sample_;
  dds::DataWriter* writer_ = nullptr;
};

/// The 16 bytes of a handle as one number.
std::uint64_t number_of(const dds::InstanceHandle_t& handle) noexcept {
  std::uint64_t number = kHashSeed;
  for (int i = 0; i < 16; ++i) number = hashed(number, handle.value[i]);
  return number;
}
std::uint64_t number_of(const rtps::GuidPrefix_t& participant) noexcept {
  std::uint64_t number = kHashSeed;
  for (const auto byte : participant.value) number = hashed(number, byte);
  return number;
}

/// The programs of other participants, as discovery describes them.
class FastPeers final : public dds::DomainParticipantListener {
 public:
  /// Whether another program has taken over the UDP port of this participant. Then its program is dead, also where the
  /// lease has not expired. Fast DDS 2.9 renews the leases of all writers whenever any participant renews its own.
  [[nodiscard]] bool replaced(std::uint64_t participant) const noexcept {
    const std::lock_guard lock(mutex_);
    return replaced_.contains(participant);
  }
  /// Its program, also after it has gone.
  [[nodiscard]] std::string program(std::uint64_t participant) const {
    const std::lock_guard lock(mutex_);
    const auto found = programs_.find(participant);
    return found == programs_.end() ? "" : found->second;
  }
  /// Changes with each participant that is replaced.
  [[nodiscard]] std::uint64_t replacements() const noexcept { return replacements_; }

 private:
  void on_participant_discovery(dds::DomainParticipant*, rtps::ParticipantDiscoveryInfo&& found) override {
    const std::uint64_t participant = number_of(found.info.m_guid.guidPrefix);
    const std::lock_guard lock(mutex_);
    if (found.status == rtps::ParticipantDiscoveryInfo::REMOVED_PARTICIPANT ||
        found.status == rtps::ParticipantDiscoveryInfo::DROPPED_PARTICIPANT) {
      replaced_.erase(participant);
      std::erase_if(owners_, [&](const auto& one) { return one.second == participant; });
      return;
    }
    if (programs_.size() < kMostPrograms) programs_.try_emplace(participant, describe(found.info));
    for (const rtps::Locator_t& port : found.info.metatraffic_locators.unicast) {
      const auto [owner, is_new] = owners_.try_emplace(port, participant);
      if (is_new || owner->second == participant) continue;
      replaced_.insert(std::exchange(owner->second, participant));
      ++replacements_;
    }
  }

  static std::string describe(const rtps::ParticipantProxyData& data) {
    std::string process, host;
    for (const auto& property : data.m_properties) {
      if (std::ranges::count(kProcessProperties, property.first()) > 0) process = property.second();
      if (std::ranges::count(kHostProperties, property.first()) > 0) host = property.second();
    }
    return program_text(data.m_participantName.to_string(), process, host.substr(0, host.find(':')));
  }

  static constexpr std::size_t kMostPrograms = 1024;
  mutable std::mutex mutex_;
  std::map<std::uint64_t, std::string> programs_;
  std::map<rtps::Locator_t, std::uint64_t> owners_;
  std::set<std::uint64_t> replaced_;
  std::atomic<std::uint64_t> replacements_ = 0;
};

class FastReader final : public HoldingReader, dds::DataReaderListener {
 public:
  FastReader(dds::DomainParticipant* participant, dds::Subscriber* subscriber, dds::TopicDescription* topic,
             const EndpointSpec& spec, const dds::DataReaderQos& qos, const FastPeers& peers, EventSink& events)
      : HoldingReader(spec, events), participant_(participant), subscriber_(subscriber), peers_(peers) {
    reader_ = require(subscriber->create_datareader(topic, qos, this, dds::StatusMask::all()),
                      fmt::format("reader of {}", spec.topic.name));
  }

  ~FastReader() override {
    stop_listening<dds::DataReaderListener>(*reader_);
    subscriber_->delete_datareader(reader_);
    participant_->delete_subscriber(subscriber_);
  }

  [[nodiscard]] int alive_writers() const noexcept override {
    const std::lock_guard lock(mutex_);
    return static_cast<int>(std::ranges::count_if(
        matched_, [&](const Matched& one) { return one.alive && !peers_.replaced(one.participant); }));
  }

  [[nodiscard]] std::uint64_t participant_of(std::uint64_t writer) const noexcept override {
    const std::lock_guard lock(mutex_);
    const auto one = std::ranges::find(matched_, writer, &Matched::writer);
    return one == matched_.end() ? 0 : one->participant;
  }
  [[nodiscard]] std::string program_of(std::uint64_t writer) const override {
    return peers_.program(participant_of(writer));
  }

 private:
  /// A writer that matches or has matched.
  struct Matched {
    std::uint64_t writer = 0;
    std::uint64_t participant = 0;
    bool alive = false;
  };

  void on_data_available(dds::DataReader* reader) override {
    if (const std::uint64_t now = peers_.replacements(); replacements_.exchange(now) != now) bury_replaced();
    drain([&](std::vector<std::uint8_t>& cdr, std::uint64_t& writer) {
      dds::SampleInfo info;
      bool taken = false;
      std::swap(sample_.received, cdr);
      while (!taken && reader->take_next_sample(&sample_, &info) == ReturnCode_t::RETCODE_OK) taken = info.valid_data;
      std::swap(sample_.received, cdr);
      if (taken) writer = number_of(info.publication_handle);
      return taken;
    });
  }
  void on_subscription_matched(dds::DataReader*, const dds::SubscriptionMatchedStatus& status) override {
    note(status.last_publication_handle, [&](Matched& one) { one.alive &= status.current_count_change > 0; });
    if (status.current_count_change < 0) bury(number_of(status.last_publication_handle));
    match(status);
  }
  void on_requested_deadline_missed(dds::DataReader*, const dds::RequestedDeadlineMissedStatus& status) override {
    miss_deadline(status);
  }
  void on_liveliness_changed(dds::DataReader*, const dds::LivelinessChangedStatus& status) override {
    if (status.alive_count_change != 0) {
      note(status.last_publication_handle, [&](Matched& one) { one.alive = status.alive_count_change > 0; });
      if (status.alive_count_change < 0) bury(number_of(status.last_publication_handle));
    }
    change_liveliness(status);
  }
  void on_sample_rejected(dds::DataReader*, const dds::SampleRejectedStatus& status) override { reject(status); }
  void on_requested_incompatible_qos(dds::DataReader*, const dds::RequestedIncompatibleQosStatus& status) override {
    differ(status);
  }
  void on_sample_lost(dds::DataReader*, const dds::SampleLostStatus& status) override { lose(status); }

  /// Changes what is known of a writer. The oldest dead one is forgotten where there are many.
  template <class Change>
  void note(const dds::InstanceHandle_t& handle, Change change) noexcept {
    const rtps::GUID_t writer = rtps::iHandle2GUID(handle);
    const std::lock_guard lock(mutex_);
    auto one = std::ranges::find(matched_, number_of(handle), &Matched::writer);
    if (one == matched_.end()) {
      const auto dead = std::ranges::find(matched_, false, &Matched::alive);
      if (matched_.size() >= kMostNoted && dead != matched_.end()) matched_.erase(dead);
      one = matched_.insert(matched_.end(), {number_of(handle), number_of(writer.guidPrefix), false});
    }
    change(*one);
  }

  void bury_replaced() noexcept {
    const std::lock_guard lock(mutex_);
    for (const Matched& one : matched_) {
      if (peers_.replaced(one.participant)) bury(one.writer);
    }
  }

  static constexpr std::size_t kMostNoted = 256;
  dds::DomainParticipant* participant_;
  dds::Subscriber* subscriber_;
  const FastPeers& peers_;
  std::atomic<std::uint64_t> replacements_ = 0;
  Sample sample_;  // only one thread drains at a time
  mutable std::mutex mutex_;
  std::vector<Matched> matched_;
  dds::DataReader* reader_ = nullptr;
};

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wnon-virtual-dtor"  // of the vendor's interfaces
/// Refuses samples before they take room. Fast DDS 2.9 frees the room of a key only when all writers of the key are
/// gone, and accepts no new key once kMostKeys have room.
class KeyFilter final : public dds::IContentFilter {
 public:
  KeyFilter(const TopicSpec& topic, EventSink& events) : topic_(topic), events_(events) {}
  bool evaluate(const SerializedPayload& payload, const FilterSampleInfo&, const GUID_t&) const override {
    if (is_known_key(topic_, {payload.data, payload.length})) return true;
    events_.report(Event::rejected, 1, "reader", topic_.name, kUnknownKey);
    return false;
  }
  [[nodiscard]] const char* type() const noexcept { return topic_.type; }

 private:
  const TopicSpec topic_;
  EventSink& events_;
};

class KeyFilters final : public dds::IContentFilterFactory {
 public:
  static constexpr const char* kName = "subworld_known_keys";
  void add(const TopicSpec& topic, EventSink& events) { filters_.emplace_back(topic, events); }

 private:
  ReturnCode_t create_content_filter(const char*, const char* type, const dds::TopicDataType*, const char*,
                                     const ParameterSeq&, dds::IContentFilter*& filter) override {
    for (KeyFilter& one : filters_) {
      if (std::string_view(one.type()) == type) filter = &one;
    }
    return filter == nullptr ? ReturnCode_t::RETCODE_BAD_PARAMETER : ReturnCode_t::RETCODE_OK;
  }
  ReturnCode_t delete_content_filter(const char*, dds::IContentFilter*) override { return ReturnCode_t::RETCODE_OK; }

  std::deque<KeyFilter> filters_;
};
#pragma GCC diagnostic pop

/// The policies that readers and writers share.
template <class EndpointQos>
void apply(const Qos& from, EndpointQos& to) {
  to.reliability().kind = from.reliable ? dds::RELIABLE_RELIABILITY_QOS : dds::BEST_EFFORT_RELIABILITY_QOS;
  to.reliability().max_blocking_time = duration(from.max_blocking_s);
  to.durability().kind = from.transient_local ? dds::TRANSIENT_LOCAL_DURABILITY_QOS : dds::VOLATILE_DURABILITY_QOS;
  to.history().kind = from.keep_all ? dds::KEEP_ALL_HISTORY_QOS : dds::KEEP_LAST_HISTORY_QOS;
  to.history().depth = from.depth;
  to.resource_limits().max_samples = 0;  // unlimited
  // With an unlimited number of instances the library stores `depth` samples of all keys together, not of each.
  to.resource_limits().max_instances = from.keep_all ? 0 : kMostKeys;
  to.resource_limits().max_samples_per_instance = 0;
  if (from.deadline_s > 0.0) to.deadline().period = duration(from.deadline_s);
  to.liveliness().kind = dds::AUTOMATIC_LIVELINESS_QOS;
  to.liveliness().lease_duration = duration(from.lease_s);
  to.liveliness().announcement_period = duration(0.4 * from.lease_s);
  to.data_sharing().off();
  to.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
}

/// Requests lost datagrams again after milliseconds, not after the default's seconds.
void hurry(dds::DataWriterQos& qos) {
  auto& times = qos.reliable_writer_qos().times;
  times.initialHeartbeatDelay = duration(0.001);
  times.heartbeatPeriod = duration(0.020);
  times.nackResponseDelay = duration(0.0);
  times.nackSupressionDuration = duration(0.0);
}

void hurry(dds::DataReaderQos& qos) {
  auto& times = qos.reliable_reader_qos().times;
  times.initialAcknackDelay = duration(0.005);
  times.heartbeatResponseDelay = duration(0.001);
}

/// Loads the user's settings.
void load_settings(dds::DomainParticipantFactory& factory, const Opening& opening, dds::DomainParticipantQos& qos) {
  if (opening.settings_file.empty()) return;
  const std::string& file = opening.settings_file;
  eprosima::fastrtps::xmlparser::XMLProfileManager::DeleteInstance();  // discards the file of an earlier bus
  if (factory.load_XML_profiles_file(file) != ReturnCode_t::RETCODE_OK) {
    fail(fmt::format("{}: not a valid profile file; compare it with deploy/qos/fastdds.xml", file));
  }
  if (opening.settings_from_environment) {
    // As the library does: the default profile, whatever its name.
    factory.load_profiles();
    factory.get_default_participant_qos(qos);
  } else if (factory.get_participant_qos_from_profile(kProfile, qos) != ReturnCode_t::RETCODE_OK) {
    fail(fmt::format("{}: has no participant profile \"{}\"; compare it with deploy/qos/fastdds.xml", file, kProfile));
  }
}

void use_interface(dds::DomainParticipantQos& qos, const std::string& address, int participants) {
  auto udp = std::make_shared<UDPv4TransportDescriptor>();
  udp->interfaceWhiteList = {address};
  udp->maxMessageSize = kMessageBytes;
  udp->maxInitialPeersRange = static_cast<std::uint32_t>(participants);
  udp->sendBufferSize = 1U << 20U;
  udp->receiveBufferSize = 4U << 20U;
  qos.transport().user_transports = {udp};
  qos.transport().use_builtin_transports = false;  // no shared memory: no files in /dev/shm

  rtps::Locator_t here;
  rtps::IPLocator::setIPv4(here, address);
  // Explicit unicast locators suppress the multicast ones; port 0 means the well-known port.
  qos.wire_protocol().builtin.metatrafficUnicastLocatorList.clear();
  qos.wire_protocol().builtin.metatrafficUnicastLocatorList.push_back(here);
  qos.wire_protocol().default_unicast_locator_list.clear();
  qos.wire_protocol().default_unicast_locator_list.push_back(here);
}

void use_peers(dds::DomainParticipantQos& qos, const std::vector<std::string>& peers) {
  auto& list = qos.wire_protocol().builtin.initialPeersList;
  list.clear();
  for (const std::string& peer : peers) {
    rtps::Locator_t there;
    rtps::IPLocator::setIPv4(there, peer);
    list.push_back(there);
  }
}

/// True if the UDP port is free.
bool port_is_free(const std::string& interface_address, int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  inet_pton(AF_INET, interface_address.c_str(), &address.sin_addr);
  const int handle = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const bool free = bind(handle, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  close(handle);
  return free;
}

/// The library numbers the participants of a process in ascending order, until their ports are outside the range that
/// peers try. This function returns the lowest number whose ports are free. If another process takes it first, the
/// library itself moves on.
int free_participant_index(const std::string& interface_address, int domain, int participants) {
  const rtps::PortParameters ports;
  const int first = ports.portBase + ports.domainIDGain * domain;
  for (int index = 0; index < participants; ++index) {
    const int own = first + ports.participantIDGain * index;
    if (port_is_free(interface_address, own + ports.offsetd1) &&
        port_is_free(interface_address, own + ports.offsetd3)) {
      return index;
    }
  }
  fail(fmt::format(
      "domain {}: the ports of all {} participants on {} are in use; choose another --domain or stop programs "
      "that still run",
      domain, participants, interface_address));
}

/// The threads of this process with real-time priority. They are numbered in the order of their start.
std::set<pid_t> realtime_threads() {
  std::set<pid_t> threads;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/task", ignored)) {
    const pid_t thread = std::atoi(entry.path().filename().c_str());
    if (sched_getscheduler(thread) == SCHED_FIFO) threads.insert(thread);
  }
  return threads;
}

/// Returns the thread that repeats samples to default scheduling. Fast DDS 2.9 starts it as the last one of a
/// participant. It spins while another thread holds the lock of the writer whose samples it repeats. With real-time
/// priority, it would spin for ever on a core where that thread has a lower one.
void lower_repeating_thread(const std::set<pid_t>& before) {
  const std::set<pid_t> now = realtime_threads();
  if (now.empty() || before.contains(*now.rbegin())) return;
  const sched_param whenever{};
  sched_setscheduler(*now.rbegin(), SCHED_OTHER, &whenever);
}

class FastBackend final : public Backend {
 public:
  FastBackend(const Opening& opening, EventSink& events) : events_(events) {
    // All data goes over the network, so that a test in one process behaves as on two machines.
    eprosima::fastrtps::LibrarySettingsAttributes library;
    library.intraprocess_delivery = eprosima::fastrtps::INTRAPROCESS_OFF;
    eprosima::fastrtps::xmlparser::XMLProfileManager::library_settings(library);

    factory_ = dds::DomainParticipantFactory::get_shared_instance();
    const std::set<pid_t> threads = realtime_threads();
    participant_ = factory_->create_participant(static_cast<std::uint32_t>(opening.domain), settings(opening), &peers_,
                                                dds::StatusMask::none());
    lower_repeating_thread(threads);
    if (participant_ == nullptr) {
      fail(fmt::format(
          "no participant in domain {} ({}): its ports are in use or its settings do not fit; choose another "
          "--domain or look for programs that still run",
          opening.domain, route_));
    }
    participant_->register_content_filter_factory(KeyFilters::kName, &filters_);
  }

  ~FastBackend() override {
    participant_->delete_contained_entities();
    factory_->delete_participant(participant_);
  }

  std::unique_ptr<BackendWriter> create_writer(const EndpointSpec& spec) override {
    dds::PublisherQos publisher_qos = dds::PUBLISHER_QOS_DEFAULT;
    if (!spec.partition.empty()) publisher_qos.partition().push_back(spec.partition.c_str());
    dds::Publisher* publisher = require(participant_->create_publisher(publisher_qos), "publisher");
    dds::DataWriterQos qos = dds::DATAWRITER_QOS_DEFAULT;
    apply(spec.qos, qos);
    hurry(qos);
    qos.publish_mode().kind = dds::SYNCHRONOUS_PUBLISH_MODE;
    qos.writer_resource_limits().reader_filters_allocation = {0, 0};  // readers filter
    return std::make_unique<FastWriter>(participant_, publisher, topic(spec.topic), spec, qos, events_);
  }

  std::unique_ptr<BackendReader> create_reader(const EndpointSpec& spec) override {
    dds::SubscriberQos subscriber_qos = dds::SUBSCRIBER_QOS_DEFAULT;
    if (!spec.partition.empty()) subscriber_qos.partition().push_back(spec.partition.c_str());
    dds::Subscriber* subscriber = require(participant_->create_subscriber(subscriber_qos), "subscriber");
    dds::DataReaderQos qos = dds::DATAREADER_QOS_DEFAULT;
    apply(spec.qos, qos);
    hurry(qos);
    // Samples are taken in the library's own threads, and at once.
    qos.reliability().max_blocking_time = duration(1.0);
    dds::TopicDescription* from = topic(spec.topic);
    if (spec.topic.key_words > 0) from = filtered(spec.topic);
    return std::make_unique<FastReader>(participant_, subscriber, from, spec, qos, peers_, spec.events_or(events_));
  }

 private:
  dds::DomainParticipantQos settings(const Opening& opening) {
    dds::DomainParticipantQos qos;
    load_settings(*factory_, opening, qos);
    auto& discovery = qos.wire_protocol().builtin.discovery_config;
    if (discovery == rtps::DiscoverySettings{}) {
      discovery.leaseDuration = duration(kLease_s);
      discovery.leaseDuration_announcementperiod = duration(1.0);
      discovery.initial_announcements.count = 10;
      discovery.initial_announcements.period = duration(0.05);
    }

    const Route route(opening, !qos.transport().user_transports.empty(),
                      !qos.wire_protocol().builtin.initialPeersList.empty());
    if (!route.address.empty()) {
      use_interface(qos, route.address, opening.participants);
      qos.wire_protocol().participant_id = free_participant_index(route.address, opening.domain, opening.participants);
    }
    if (route.peers) use_peers(qos, *route.peers);
    route_ = route.text();
    qos.name(opening.participant_name.c_str());
    return qos;
  }

  dds::Topic* topic(const TopicSpec& spec) {
    dds::Topic*& topic = topics_[spec.name];
    if (topic == nullptr) {
      dds::TypeSupport type(new BytesType(spec));
      if (type.register_type(participant_) == ReturnCode_t::RETCODE_OK) {
        topic = participant_->create_topic(spec.name, spec.type, dds::TOPIC_QOS_DEFAULT);
      }
    }
    return require(topic, fmt::format("topic {} of type {}", spec.name, spec.type));
  }

  dds::ContentFilteredTopic* filtered(const TopicSpec& spec) {
    dds::ContentFilteredTopic*& made = filtered_[spec.name];
    if (made == nullptr) {
      filters_.add(spec, events_);
      made = participant_->create_contentfilteredtopic(fmt::format("{}_of_known_keys", spec.name), topic(spec), "key",
                                                       {}, KeyFilters::kName);
    }
    return require(made, fmt::format("filter of {}", spec.name));
  }

  EventSink& events_;
  FastPeers peers_;
  KeyFilters filters_;
  std::map<std::string, dds::ContentFilteredTopic*> filtered_;
  std::shared_ptr<dds::DomainParticipantFactory> factory_;
  dds::DomainParticipant* participant_ = nullptr;
  std::map<std::string, dds::Topic*> topics_;
};

}  // namespace
}  // namespace subworld::wire

extern "C" subworld::wire::Backend* subworld_open_backend(const subworld::wire::Opening& opening,
                                                          subworld::wire::EventSink& events) {
  return new subworld::wire::FastBackend(opening, events);
}
extern "C" const char* subworld_backend_version() { return FASTRTPS_VERSION_STR; }
