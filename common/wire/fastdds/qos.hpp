#pragma once

#include "wire/backend.hpp"
#include "wire/fastdds/vendor.hpp"

namespace subworld::wire::fast {

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
inline void hurry(dds::DataWriterQos& qos, double repeat_s) {
  set_times(qos, duration(0.001), duration(repeat_s), duration(0.0));
}

inline void hurry(dds::DataReaderQos& qos) { set_times(qos, duration(0.005), duration(0.001)); }

}  // namespace subworld::wire::fast
