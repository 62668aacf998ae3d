#pragma once

#include "wire/cyclonedds/peers.hpp"

#include <cmath>
#include <memory>
#include <span>
#include <vector>

namespace subworld::wire::cyclone {

inline constexpr std::int32_t kKeptForLateReaders = 64;  // of each key

using QosPointer = std::unique_ptr<dds_qos_t, decltype([](dds_qos_t* qos) { dds_delete_qos(qos); })>;
using ListenerPointer =
    std::unique_ptr<dds_listener_t, decltype([](dds_listener_t* one) { dds_delete_listener(one); })>;

inline dds_duration_t nanoseconds(double seconds) {
  return std::isinf(seconds) ? DDS_INFINITY : static_cast<dds_duration_t>(std::llround(seconds * 1e9));
}

inline QosPointer make_qos(const Qos& from) {
  QosPointer qos(dds_create_qos());
  dds_qset_reliability(qos.get(), from.reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT,
                       nanoseconds(from.max_blocking_s));
  dds_qset_durability(qos.get(), from.transient_local ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  const std::int32_t for_late_readers = from.keep_all ? kKeptForLateReaders : from.depth;
  dds_qset_durability_service(qos.get(), 0, DDS_HISTORY_KEEP_LAST, for_late_readers, DDS_LENGTH_UNLIMITED,
                              DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
  dds_qset_history(qos.get(), from.keep_all ? DDS_HISTORY_KEEP_ALL : DDS_HISTORY_KEEP_LAST, from.depth);
  dds_qset_resource_limits(qos.get(), DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
  if (from.deadline_s > 0.0) dds_qset_deadline(qos.get(), nanoseconds(from.deadline_s));
  dds_qset_liveliness(qos.get(), DDS_LIVELINESS_AUTOMATIC, nanoseconds(from.lease_s));
  const dds_data_representation_id_t plain_cdr = DDS_DATA_REPRESENTATION_XCDR1;
  dds_qset_data_representation(qos.get(), 1, &plain_cdr);
  return qos;
}

class CycloneWriter final : public BackendWriter {
 public:
  CycloneWriter(dds_entity_t publisher, dds_entity_t topic, const EndpointSpec& spec, EventSink& events)
      : BackendWriter(spec.topic.name, events), publisher_(publisher) {
    const QosPointer qos = make_qos(spec.qos);
    if (spec.qos.writes_live)
      dds_qset_liveliness(qos.get(), DDS_LIVELINESS_MANUAL_BY_TOPIC, nanoseconds(spec.qos.lease_s));
    writer_ = require(dds_create_writer(publisher, topic, qos.get(), listener().get()),
                      fmt::format("writer of {}", spec.topic.name));
  }
  ~CycloneWriter() override { dds_delete(publisher_); }

  bool write(std::span<const std::uint8_t> cdr) noexcept override { return dds_write(writer_, &cdr) == DDS_RETCODE_OK; }
  bool wait_for_acknowledgments(double timeout_s) noexcept override {
    return dds_wait_for_acks(writer_, nanoseconds(timeout_s)) == DDS_RETCODE_OK;
  }

 private:
  static CycloneWriter& of(void* self) { return *static_cast<CycloneWriter*>(self); }
  ListenerPointer listener() {
    ListenerPointer made(dds_create_listener(this));
    dds_listener_t* const to = made.get();
    dds_lset_publication_matched(to, [](dds_entity_t, auto status, void* self) { of(self).match(status); });
    dds_lset_offered_deadline_missed(to, [](dds_entity_t, auto status, void* self) { of(self).miss_deadline(status); });
    dds_lset_offered_incompatible_qos(to, [](dds_entity_t, auto status, void* self) { of(self).differ(status); });
    return made;
  }

  dds_entity_t publisher_;
  dds_entity_t writer_ = 0;
};

class CycloneReader final : public HoldingReader {
 public:
  CycloneReader(dds_entity_t subscriber, dds_entity_t topic, const EndpointSpec& spec, const CyclonePeers& peers,
                EventSink& events)
      : HoldingReader(spec, events), subscriber_(subscriber), peers_(peers) {
    reader_ = require(dds_create_reader(subscriber, topic, make_qos(spec.qos).get(), listener().get()),
                      fmt::format("reader of {}", spec.topic.name));
  }
  ~CycloneReader() override { dds_delete(subscriber_); }

  [[nodiscard]] std::uint64_t participant_of(std::uint64_t writer) const noexcept override {
    return peers_.participant_of(writer);
  }
  [[nodiscard]] std::optional<PeerProgram> program_of(std::uint64_t writer) const override {
    return peers_.program_of(writer);
  }

 private:
  static CycloneReader& of(void* self) { return *static_cast<CycloneReader*>(self); }
  void hold(dds_entity_t reader) noexcept {
    drain([&](std::vector<std::uint8_t>& cdr, std::uint64_t& writer) {
      void* room = &cdr;
      dds_sample_info_t info;
      while (dds_take(reader, &room, &info, 1, 1) == 1) {
        writer = info.publication_handle;
        if (info.valid_data) return true;
      }
      return false;
    });
  }
  ListenerPointer listener() {
    ListenerPointer made(dds_create_listener(this));
    dds_listener_t* const to = made.get();
    dds_lset_data_available(to, [](dds_entity_t reader, void* self) { of(self).hold(reader); });
    dds_lset_subscription_matched(to, [](dds_entity_t, auto status, void* self) {
      of(self).match(status);
      if (status.current_count_change < 0) of(self).bury(status.last_publication_handle);
    });
    dds_lset_requested_deadline_missed(to,
                                       [](dds_entity_t, auto status, void* self) { of(self).miss_deadline(status); });
    dds_lset_requested_incompatible_qos(to, [](dds_entity_t, auto status, void* self) { of(self).differ(status); });
    dds_lset_liveliness_changed(to, [](dds_entity_t, auto status, void* self) {
      of(self).change_liveliness(status);
      if (status.alive_count_change < 0) of(self).bury(status.last_publication_handle);
    });
    dds_lset_sample_lost(to, [](dds_entity_t, auto status, void* self) { of(self).lose(status); });
    dds_lset_sample_rejected(to, [](dds_entity_t, auto status, void* self) { of(self).reject(status); });
    return made;
  }

  dds_entity_t subscriber_;
  const CyclonePeers& peers_;
  dds_entity_t reader_ = 0;
};

}  // namespace subworld::wire::cyclone
