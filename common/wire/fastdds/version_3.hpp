#pragma once

#include <sched.h>

#include <fastdds/config.hpp>
#include <fastdds/dds/core/ReturnCode.hpp>
#include <fastdds/dds/core/Time_t.hpp>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/rtps/common/Guid.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.hpp>
#include <fastdds/utils/IPLocator.hpp>

#include <fstream>
#include <iterator>
#include <string>

/// Fast DDS 3.1.
namespace subworld::wire::fast {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastdds::rtps;
using dds::c_TimeInfinite;
using dds::Duration_t;
using dds::ParticipantBuiltinTopicData;
using dds::ReturnCode_t;
using rtps::ParticipantDiscoveryStatus;
using rtps::UDPv4TransportDescriptor;

inline constexpr const char* kVersion = FASTDDS_VERSION_STR;
inline constexpr ReturnCode_t kOk = dds::RETCODE_OK;
inline constexpr ReturnCode_t kTimeout = dds::RETCODE_TIMEOUT;
inline constexpr ReturnCode_t kBadParameter = dds::RETCODE_BAD_PARAMETER;

/// Of `DataWriter::write`.
inline bool is_written(ReturnCode_t result) { return result == kOk; }

class DataType : public dds::TopicDataType {
 public:
  DataType(const char* name, std::uint32_t bytes, bool has_key) {
    set_name(name);
    max_serialized_type_size = bytes;
    is_compute_key_provided = has_key;
  }
};

using ParticipantListener = dds::DomainParticipantListener;

/// The settings of participants in a file.
class SettingsFile {
 public:
  SettingsFile(dds::DomainParticipantFactory& factory, const std::string& file) : factory_(factory) {
    std::ifstream stream(file);
    text_.assign(std::istreambuf_iterator<char>(stream), {});
  }
  [[nodiscard]] bool valid() const {
    dds::DomainParticipantQos first;
    return factory_.get_participant_qos_from_xml(text_, first) == kOk;
  }
  /// As the library does: the default profile, whatever its name.
  void read_default(dds::DomainParticipantQos& qos) const { factory_.get_default_participant_qos_from_xml(text_, qos); }
  [[nodiscard]] bool read(const char* profile, dds::DomainParticipantQos& qos) const {
    return factory_.get_participant_qos_from_xml(text_, qos, profile) == kOk;
  }

 private:
  dds::DomainParticipantFactory& factory_;
  std::string text_;
};

inline void disable_intraprocess(dds::DomainParticipantFactory& factory) {
  eprosima::fastdds::LibrarySettings library;
  library.intraprocess_delivery = eprosima::fastdds::INTRAPROCESS_OFF;
  factory.set_library_settings(library);
}

/// Null if it does not start. Keeps the thread that repeats samples from real-time priority: it spins while another
/// thread holds the lock of the writer whose samples it repeats.
inline dds::DomainParticipant* create_participant(dds::DomainParticipantFactory& factory, std::uint32_t domain,
                                                  dds::DomainParticipantQos qos,
                                                  dds::DomainParticipantListener& listener) {
  qos.builtin_controllers_sender_thread().scheduling_policy = SCHED_BATCH;
  return factory.create_participant(domain, qos, &listener, dds::StatusMask::none());
}

inline void set_times(dds::DataWriterQos& qos, Duration_t first_heartbeat, Duration_t heartbeats, Duration_t answer) {
  auto& times = qos.reliable_writer_qos().times;
  times.initial_heartbeat_delay = first_heartbeat;
  times.heartbeat_period = heartbeats;
  times.nack_response_delay = answer;
  times.nack_supression_duration = answer;
}
inline void set_times(dds::DataReaderQos& qos, Duration_t first_answer, Duration_t answer) {
  auto& times = qos.reliable_reader_qos().times;
  times.initial_acknack_delay = first_answer;
  times.heartbeat_response_delay = answer;
}

}  // namespace subworld::wire::fast
