#include "wire/fastdds/settings.hpp"

#include "support/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

namespace subworld::wire::fast {
namespace {

using eprosima::fastdds::rtps::UDPv4TransportDescriptor;

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

/// Of the only transport, with --interface 127.0.0.1.
std::uint32_t message_bytes(const std::string& settings_file) {
  std::string route;
  const Opening opening{.domain = 1,
                        .participants = 120,
                        .participant_name = "test",
                        .interface_address = kDefaultInterface,
                        .settings_file = settings_file};
  const auto qos = participant_qos(*dds::DomainParticipantFactory::get_instance(), opening, route);
  const auto& transports = qos.transport().user_transports;
  EXPECT_EQ(transports.size(), 1U);
  const auto* udp = dynamic_cast<const UDPv4TransportDescriptor*>(transports.front().get());
  EXPECT_EQ(udp->interfaceWhiteList, std::vector<std::string>{kDefaultInterface});
  return udp->maxMessageSize;
}

TEST(FastSettings, AnInterfaceKeepsTheLengthOfMessages) {
  EXPECT_EQ(message_bytes(""), static_cast<std::uint32_t>(kMessageBytes));
  const TemporaryFolder folder;
  EXPECT_EQ(message_bytes(folder.write("qos.xml", kSettings)), 1400U);
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
