// The Cyclone DDS back end.

#include "wire/backend.hpp"
#include "wire/cyclonedds/endpoints.hpp"
#include "wire/cyclonedds/samples.hpp"
#include "wire/cyclonedds/settings.hpp"

#include <dds/version.h>

#include <chrono>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string_view>
#include <thread>
#include <utility>

namespace subworld::wire::cyclone {
namespace {

/// Captures the log, where alone the library states why it refused the settings.
class LogCapture {
 public:
  LogCapture() {
    dds_set_log_sink(
        [](void* to, const dds_log_data_t* line) {
          auto& text = *static_cast<std::string*>(to);
          text += text.empty() ? "" : "; ";
          text += std::string_view(line->message).substr(0, std::string_view(line->message).find('\n'));
        },
        &text_);
  }
  ~LogCapture() { dds_set_log_sink(nullptr, nullptr); }
  LogCapture(const LogCapture&) = delete;
  LogCapture& operator=(const LogCapture&) = delete;
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
};

/// Where alone the library says that another program did not prove its role.
void hear_of_the_unproven(void* to, const dds_log_data_t* line) {
  const std::string_view text = line->message;
  if (text.find("handshake") != std::string_view::npos)
    static_cast<EventSink*>(to)->report(Event::refused, 1, kParticipant, kParticipant, "");
}

class CycloneBackend final : public Backend {
 public:
  CycloneBackend(const Opening& opening, EventSink& events) : events_(events) {
    const std::string settings = make_settings(opening, route_);
    open_domain(opening, settings);
    try {
      QosPointer qos(dds_create_qos());
      dds_qset_entity_name(qos.get(), opening.participant_name.c_str());
      if (opening.keys) use_keys(qos.get(), *opening.keys);
      const LogCapture log;
      participant_ = dds_create_participant(id_, qos.get(), nullptr);
      if (participant_ < 0)
        fail(fmt::format("no participant: {}{}", opening.keys ? kKeysCure : "",
                         log.text().empty() ? dds_strretcode(participant_) : log.text()));
      peers_.open(participant_);
    } catch (...) {
      close();
      throw;
    }
    if (opening.keys) dds_set_log_sink(hear_of_the_unproven, &events_);
  }

  ~CycloneBackend() override {
    dds_set_log_sink(nullptr, nullptr);
    close();
  }

  std::unique_ptr<BackendWriter> create_writer(const EndpointSpec& spec) override {
    const dds_entity_t publisher =
        require(dds_create_publisher(participant_, partition(spec).get(), nullptr), "publisher");
    return std::make_unique<CycloneWriter>(publisher, topic(spec.topic), spec, events_);
  }

  std::unique_ptr<BackendReader> create_reader(const EndpointSpec& spec) override {
    const dds_entity_t subscriber =
        require(dds_create_subscriber(participant_, partition(spec).get(), nullptr), "subscriber");
    return std::make_unique<CycloneReader>(subscriber, topic(spec.topic), spec, peers_, spec.events_or(events_));
  }

 private:
  static QosPointer partition(const EndpointSpec& spec) {
    QosPointer qos(dds_create_qos());
    const char* name = spec.partition.c_str();
    if (*name != '\0') dds_qset_partition(qos.get(), 1, &name);
    return qos;
  }

  dds_entity_t topic(const TopicSpec& spec) {
    dds_entity_t& topic = topics_[spec.name];
    if (topic == 0) topic = create_topic(participant_, spec);
    return topic;
  }

  /// Cyclone allows one domain of a number in a process. A second bus gets another internal number and the same
  /// external one.
  void open_domain(const Opening& opening, const std::string& settings) {
    const std::lock_guard lock(domains_mutex);
    id_ = static_cast<dds_domainid_t>(opening.domain);
    constexpr dds_domainid_t kLastWithKeys = 230;
    for (dds_domainid_t free = kLastWithKeys; domains.contains(id_); --free) id_ = free;
    std::string all = settings;
    if (id_ != static_cast<dds_domainid_t>(opening.domain)) {
      all += fmt::format(
          ",<CycloneDDS><Domain Id=\"any\"><Discovery><ExternalDomainId>{}</ExternalDomainId></Discovery>"
          "</Domain></CycloneDDS>",
          opening.domain);
    }
    const LogCapture log;
    domain_ = dds_create_domain(id_, all.c_str());
    if (domain_ < 0) {
      fail(
          fmt::format("domain {} ({}{}{}) was refused: {}; correct the settings, or look for programs "
                      "that still run if no participant index is free",
                      opening.domain, route_, opening.settings_file.empty() ? "" : " settings=", opening.settings_file,
                      log.text().empty() ? dds_strretcode(domain_) : log.text()));
    }
    domains.insert(id_);
  }

  /// Cyclone ends its receiving threads by a datagram to itself. Where the interface has vanished it waits for them for
  /// ever: then the thread that waits is left behind, and the process ends without it.
  void close() noexcept {
    constexpr std::chrono::milliseconds kLongest{1500};
    std::promise<void> deleted;
    const std::future<void> end = deleted.get_future();
    std::thread([domain = domain_, deleted = std::move(deleted)]() mutable {
      dds_delete(domain);
      deleted.set_value();
    }).detach();
    if (end.wait_for(kLongest) != std::future_status::ready) return;
    const std::lock_guard lock(domains_mutex);
    domains.erase(id_);
  }

  static inline std::mutex domains_mutex;
  static inline std::set<dds_domainid_t> domains;  ///< open in this process

  EventSink& events_;
  dds_domainid_t id_ = 0;
  dds_entity_t domain_ = 0;
  dds_entity_t participant_ = 0;
  CyclonePeers peers_;
  std::map<std::string, dds_entity_t> topics_;
};

}  // namespace
}  // namespace subworld::wire::cyclone

extern "C" subworld::wire::Backend* subworld_open_backend(const subworld::wire::Opening& opening,
                                                          subworld::wire::EventSink& events) {
  return new subworld::wire::cyclone::CycloneBackend(opening, events);
}
extern "C" const char* subworld_backend_version() { return DDS_VERSION; }
