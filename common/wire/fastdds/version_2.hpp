#pragma once

#include <sched.h>

#include <fastdds/rtps/common/Guid.h>
#include <fastdds/rtps/common/Time_t.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/attributes/LibrarySettingsAttributes.h>
#include <fastrtps/config.h>
#include <fastrtps/types/TypesBase.h>
#include <fastrtps/utils/IPLocator.h>
#include <fastrtps/xmlparser/XMLProfileManager.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <string>
#include <system_error>

/// Fast DDS 2.9, with the names of version 3.
namespace subworld::wire::fast {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;
using eprosima::fastdds::rtps::UDPv4TransportDescriptor;
using eprosima::fastrtps::c_TimeInfinite;
using eprosima::fastrtps::Duration_t;
using eprosima::fastrtps::types::ReturnCode_t;

inline constexpr const char* kVersion = FASTRTPS_VERSION_STR;
inline constexpr auto kOk = ReturnCode_t::RETCODE_OK;
inline constexpr auto kTimeout = ReturnCode_t::RETCODE_TIMEOUT;
inline constexpr auto kBadParameter = ReturnCode_t::RETCODE_BAD_PARAMETER;

/// Of `DataWriter::write`.
inline bool is_written(bool result) { return result; }

class DataType : public dds::TopicDataType {
 public:
  DataType(const char* name, std::uint32_t bytes, bool has_key) {
    setName(name);
    m_typeSize = bytes;
    m_isGetKeyDefined = has_key;
    auto_fill_type_information(false);
    auto_fill_type_object(false);
  }

  virtual bool serialize(const void* data, rtps::SerializedPayload_t& payload, dds::DataRepresentationId_t) = 0;
  virtual bool deserialize(rtps::SerializedPayload_t& payload, void* data) = 0;
  virtual std::uint32_t calculate_serialized_size(const void* data, dds::DataRepresentationId_t) = 0;
  virtual void* create_data() = 0;
  virtual void delete_data(void* data) = 0;
  virtual bool compute_key(rtps::SerializedPayload_t& payload, rtps::InstanceHandle_t& handle, bool force_md5) = 0;
  virtual bool compute_key(const void* data, rtps::InstanceHandle_t& handle, bool force_md5) = 0;

 private:
  bool serialize(void* data, rtps::SerializedPayload_t* payload) final {
    return serialize(data, *payload, dds::XCDR_DATA_REPRESENTATION);
  }
  bool deserialize(rtps::SerializedPayload_t* payload, void* data) final { return deserialize(*payload, data); }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) final {
    return [this, data] { return calculate_serialized_size(data, dds::XCDR_DATA_REPRESENTATION); };
  }
  void* createData() final { return create_data(); }
  void deleteData(void* data) final { delete_data(data); }
  bool getKey(void* data, rtps::InstanceHandle_t* handle, bool force_md5) final {
    return compute_key(data, *handle, force_md5);
  }
};

using ParticipantDiscoveryStatus = rtps::ParticipantDiscoveryInfo::DISCOVERY_STATUS;
struct ParticipantBuiltinTopicData {
  const rtps::GUID_t& guid;
  const eprosima::fastrtps::string_255& participant_name;
  const dds::ParameterPropertyList_t& properties;
  const rtps::RemoteLocatorList& metatraffic_locators;
};

class ParticipantListener : public dds::DomainParticipantListener {
  virtual void on_participant_discovery(dds::DomainParticipant*, ParticipantDiscoveryStatus reason,
                                        const ParticipantBuiltinTopicData& info, bool& should_be_ignored) = 0;
  void on_participant_discovery(dds::DomainParticipant* own, rtps::ParticipantDiscoveryInfo&& found) final {
    bool ignored = false;
    const rtps::ParticipantProxyData& info = found.info;
    on_participant_discovery(own, found.status,
                             {info.m_guid, info.m_participantName, info.m_properties, info.metatraffic_locators},
                             ignored);
  }
};

/// The settings of participants in a file.
class SettingsFile {
 public:
  SettingsFile(dds::DomainParticipantFactory& factory, const std::string& file) : factory_(factory) {
    eprosima::fastrtps::xmlparser::XMLProfileManager::DeleteInstance();  // discards the file of an earlier bus
    valid_ = factory.load_XML_profiles_file(file) == kOk;
  }
  [[nodiscard]] bool valid() const { return valid_; }
  /// As the library does: the default profile, whatever its name.
  void read_default(dds::DomainParticipantQos& qos) const {
    factory_.load_profiles();
    factory_.get_default_participant_qos(qos);
  }
  [[nodiscard]] bool read(const char* profile, dds::DomainParticipantQos& qos) const {
    return factory_.get_participant_qos_from_profile(profile, qos) == kOk;
  }

 private:
  dds::DomainParticipantFactory& factory_;
  bool valid_ = false;
};

inline void disable_intraprocess(dds::DomainParticipantFactory&) {
  eprosima::fastrtps::LibrarySettingsAttributes library;
  library.intraprocess_delivery = eprosima::fastrtps::INTRAPROCESS_OFF;
  eprosima::fastrtps::xmlparser::XMLProfileManager::library_settings(library);
}

/// The thread of this process that was started last: they are numbered in the order of their start.
inline pid_t newest_thread() {
  pid_t newest = 0;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/task", ignored))
    newest = std::max(newest, std::atoi(entry.path().filename().c_str()));
  return newest;
}

/// Null if it does not start. Keeps the thread that repeats samples from real-time priority, by the scheduling class
/// for batch work. Version 2.9 starts it as the last one of a participant. It spins while another thread holds the lock
/// of the writer whose samples it repeats. With real-time priority, it would spin for ever on a core where that thread
/// has a lower one.
inline dds::DomainParticipant* create_participant(dds::DomainParticipantFactory& factory, std::uint32_t domain,
                                                  const dds::DomainParticipantQos& qos,
                                                  dds::DomainParticipantListener& listener) {
  const pid_t before = newest_thread();
  dds::DomainParticipant* created = factory.create_participant(domain, qos, &listener, dds::StatusMask::none());
  const pid_t newest = newest_thread();
  const sched_param whenever{};
  if (newest != before) sched_setscheduler(newest, SCHED_BATCH, &whenever);
  return created;
}

inline void set_times(dds::DataWriterQos& qos, Duration_t first_heartbeat, Duration_t heartbeats, Duration_t answer) {
  auto& times = qos.reliable_writer_qos().times;
  times.initialHeartbeatDelay = first_heartbeat;
  times.heartbeatPeriod = heartbeats;
  times.nackResponseDelay = answer;
  times.nackSupressionDuration = answer;
}
inline void set_times(dds::DataReaderQos& qos, Duration_t first_answer, Duration_t answer) {
  auto& times = qos.reliable_reader_qos().times;
  times.initialAcknackDelay = first_answer;
  times.heartbeatResponseDelay = answer;
}

}  // namespace subworld::wire::fast
