// The Fast DDS back end.

#include "wire/backend.hpp"
#include "wire/fastdds/endpoints.hpp"
#include "wire/fastdds/key_filter.hpp"
#include "wire/fastdds/qos.hpp"
#include "wire/fastdds/settings.hpp"

#include <fastdds/dds/topic/ContentFilteredTopic.hpp>
#include <fastdds/dds/topic/Topic.hpp>

#include <map>
#include <memory>
#include <mutex>
#include <set>

namespace subworld::wire::fast {
namespace {

class FastBackend final : public Backend {
 public:
  FastBackend(const Opening& opening, EventSink& events) : events_(events), peers_(events) {
    factory_ = dds::DomainParticipantFactory::get_shared_instance();
    // All data goes over the network, so that a test in one process behaves as on two machines.
    disable_intraprocess(*factory_);
    const std::lock_guard lock(numbers_mutex);
    const dds::DomainParticipantQos qos = participant_qos(*factory_, opening, route_, numbers);
    number_ = qos.wire_protocol().participant_id;
    numbers.insert(number_);  // the library keeps that of a participant which does not start
    participant_ = create_participant(*factory_, static_cast<std::uint32_t>(opening.domain), qos, peers_);
    if (participant_ == nullptr) {
      fail(fmt::format(
          "no participant in domain {} ({}): {}its ports are in use or its settings do not fit; choose another "
          "--domain or look for programs that still run",
          opening.domain, route_, opening.keys ? kKeysCure : ""));
    }
    participant_->register_content_filter_factory(KeyFilters::kName, &filters_);
  }

  ~FastBackend() override {
    participant_->delete_contained_entities();
    factory_->delete_participant(participant_);
    const std::lock_guard lock(numbers_mutex);
    numbers.erase(number_);
  }

  std::unique_ptr<BackendWriter> create_writer(const EndpointSpec& spec) override {
    dds::PublisherQos publisher_qos = dds::PUBLISHER_QOS_DEFAULT;
    if (!spec.partition.empty()) publisher_qos.partition().push_back(spec.partition.c_str());
    dds::Publisher* publisher = require(participant_->create_publisher(publisher_qos), "publisher");
    dds::DataWriterQos qos = dds::DATAWRITER_QOS_DEFAULT;
    apply(spec.qos, qos);
    hurry(qos, spec.qos.repeat_s);
    if (spec.qos.writes_live) qos.liveliness().kind = dds::MANUAL_BY_TOPIC_LIVELINESS_QOS;
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
  dds::Topic* topic(const TopicSpec& spec) {
    dds::Topic*& topic = topics_[spec.name];
    if (topic == nullptr) {
      dds::TypeSupport type(new BytesType(spec));
      if (type.register_type(participant_) == kOk) {
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

  static inline std::mutex numbers_mutex;
  static inline std::set<int> numbers;  ///< of the participants of this process

  EventSink& events_;
  int number_ = -1;
  FastPeers peers_;
  KeyFilters filters_;
  std::map<std::string, dds::ContentFilteredTopic*> filtered_;
  std::shared_ptr<dds::DomainParticipantFactory> factory_;
  dds::DomainParticipant* participant_ = nullptr;
  std::map<std::string, dds::Topic*> topics_;
};

}  // namespace
}  // namespace subworld::wire::fast

extern "C" subworld::wire::Backend* subworld_open_backend(const subworld::wire::Opening& opening,
                                                          subworld::wire::EventSink& events) {
  return new subworld::wire::fast::FastBackend(opening, events);
}
extern "C" const char* subworld_backend_version() { return subworld::wire::fast::kVersion; }
