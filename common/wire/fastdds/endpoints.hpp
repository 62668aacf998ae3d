#pragma once

#include "wire/fastdds/bytes_type.hpp"
#include "wire/fastdds/peers.hpp"

#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

namespace subworld::wire::fast {

inline constexpr int kMostKept = 1024;  // acknowledged samples that a keep-all writer stores

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
      return is_written(writer_->write(&sample_));
    } catch (const std::exception&) {
      return false;
    }
  }

  bool wait_for_acknowledgments(double timeout_s) noexcept override {
    return writer_->wait_for_acknowledgments(duration(timeout_s)) == kOk;
  }

 private:
  /// Without this, a history that stores all samples for late readers would grow without bound.
  void forget() {
    std::size_t removed = 0;
    if (writer_->wait_for_acknowledgments(duration(0.0)) != kOk) return;
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
  [[nodiscard]] std::optional<PeerProgram> program_of(std::uint64_t writer) const override {
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
      while (!taken) {
        const ReturnCode_t code = reader->take_next_sample(&sample_, &info);
        // It gives up where another thread holds the reader's lock for long, as on a machine that was suspended. Nobody
        // calls again for the sample that waits.
        if (code == kTimeout) continue;
        if (code != kOk) break;
        taken = info.valid_data;
      }
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

}  // namespace subworld::wire::fast
