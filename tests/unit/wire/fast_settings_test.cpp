#include "wire/fastdds/settings.hpp"

#include "support/temporary_folder.hpp"

#include <gtest/gtest.h>

namespace subworld::wire::fast {
namespace {

constexpr const char* kSettings = R"(<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <profiles>
    <transport_descriptors>
      <transport_descriptor>
        <transport_id>short</transport_id>
        <type>UDPv4</type>
        <maxMessageSize>1400</maxMessageSize>
      </transport_descriptor>
    </transport_descriptors>
    <participant profile_name="subworld">
      <rtps>
        <useBuiltinTransports>false</useBuiltinTransports>
        <userTransports>
          <transport_id>short</transport_id>
        </userTransports>
      </rtps>
    </participant>
  </profiles>
</dds>
)";

/// Of the only transport, where a packet of the network holds `packet_bytes`: longest message that is received, and
/// sent.
std::pair<std::uint32_t, std::uint32_t> message_bytes(const std::string& settings_file, int packet_bytes) {
  std::string route;
  const Opening opening{.domain = 1,
                        .participants = 120,
                        .participant_name = "test",
                        .message_bytes = packet_bytes,
                        .interface_address = kDefaultInterface,
                        .settings_file = settings_file};
  const auto qos = participant_qos(*dds::DomainParticipantFactory::get_instance(), opening, route);
  const auto& transports = qos.transport().user_transports;
  EXPECT_EQ(transports.size(), 1U);
  const auto* udp = dynamic_cast<const UDPv4TransportDescriptor*>(transports.front().get());
  EXPECT_EQ(udp->interfaceWhiteList, std::vector<std::string>{kDefaultInterface});
  return {udp->maxMessageSize, udp->max_message_size()};
}

TEST(FastSettings, AMessageFitsAPacketAndLongerOnesAreReceived) {
  EXPECT_EQ(message_bytes("", kMessageBytes), std::pair(65500U, 65500U));
  EXPECT_EQ(message_bytes("", 1472), std::pair(65500U, 1472U));
  const TemporaryFolder folder;
  const std::string file = folder.write("qos.xml", kSettings);
  EXPECT_EQ(message_bytes(file, kMessageBytes), std::pair(1400U, 1400U)) << "the file's";
  EXPECT_EQ(message_bytes(file, 1000), std::pair(1400U, 1000U));
}

TEST(FastSettings, ProgramsOfManyUsersAnnounceThemselvesLessOften) {
  for (const std::string& file : {std::string(), std::string(SOURCE_FOLDER) + "/deploy/qos/fastdds.xml"}) {
    std::string route;
    const Opening opening{.domain = 1,
                          .participants = 120,
                          .thinning = 4.0,
                          .participant_name = "test",
                          .interface_address = kDefaultInterface,
                          .settings_file = file};
    const auto qos = participant_qos(*dds::DomainParticipantFactory::get_instance(), opening, route);
    EXPECT_EQ(qos.wire_protocol().builtin.discovery_config.leaseDuration_announcementperiod.seconds, 4) << file;
  }
}

}  // namespace
}  // namespace subworld::wire::fast
