#include "support/process.hpp"
#include "support/wire_pairs.hpp"
#include "wire/bus.hpp"

#include <gtest/gtest.h>

#include <sched.h>
#include <unistd.h>
#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

namespace subworld {
namespace {

using test::config_of;
using test::until;

class WireOpen : public ::testing::TestWithParam<Vendor> {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("subworld_wire_" + std::to_string(getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string file(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }

  BusConfig config() const { return config_of(GetParam(), domain_.number()); }

  /// Opening must throw a middleware error that contains all of these words.
  static void expect_error(const BusConfig& config, const std::vector<std::string>& words) {
    try {
      (void)open_bus(config);
      FAIL() << "opened";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::middleware);
      for (const std::string& word : words) {
        EXPECT_NE(std::string(error.what()).find(word), std::string::npos) << word << " is not in: " << error.what();
      }
    }
  }

  const test::TestDomain domain_;
  std::filesystem::path folder_;
  const std::string own_ = std::to_string(getpid());  // partition: tests of one domain may run at once
};

TEST_P(WireOpen, a_missing_plugin_is_named) {
  setenv("SUBWORLD_PLUGIN_DIR", folder_.c_str(), 1);
  expect_error(config(), {std::string("libsubworld_") + name_of(GetParam()) + ".so", "SUBWORLD_PLUGIN_DIR"});
  unsetenv("SUBWORLD_PLUGIN_DIR");
}

TEST_P(WireOpen, a_plugin_that_cannot_be_loaded_names_the_package) {
  file(std::string("libsubworld_") + name_of(GetParam()) + ".so", "not a library");
  setenv("SUBWORLD_PLUGIN_DIR", folder_.c_str(), 1);
  expect_error(config(), {"install the Debian package", GetParam() == Vendor::fastdds ? "libfast" : "libddsc"});
  unsetenv("SUBWORLD_PLUGIN_DIR");
}

TEST_P(WireOpen, wrong_domains_addresses_and_hosts_are_named) {
  auto wrong = config();
  wrong.domain = 233;
  expect_error(wrong, {"233", "0 .. 232"});
  wrong = config();
  wrong.interface_address = "192.0.2.1";  // reserved for documentation: no interface has it
  expect_error(wrong, {"192.0.2.1", "ip -brief address"});
  wrong.interface_address = "127.0.0.2";  // can be bound to, but no interface has it and both vendors refuse it
  expect_error(wrong, {"127.0.0.2", "ip -brief address"});
  wrong = config();
  wrong.peers = {"no.such.host.invalid"};
  expect_error(wrong, {"no.such.host.invalid"});
}

TEST_P(WireOpen, bad_qos_files_are_named) {
  auto wrong = config();
  wrong.qos_file = (folder_ / "absent.xml").string();
  expect_error(wrong, {"absent.xml"});
  wrong.qos_file = file("broken.xml", "<CycloneDDS><Domain><General></Domain>");
  expect_error(wrong, {"broken.xml"});
  wrong.qos_file = file("unknown.xml", "<CycloneDDS><Domain><Nonsense>1</Nonsense></Domain></CycloneDDS>");
  expect_error(wrong, {"unknown.xml"});
}

TEST_P(WireOpen, two_buses_in_one_process_come_and_go) {
  for (int round = 0; round < 3; ++round) {
    const auto first = open_bus(config());
    const auto second = open_bus(config());
    auto writer = first->writer<Control>(own_);
    auto reader = second->reader<Control>(own_);
    ASSERT_TRUE(until(*second, [&] { return writer.matched() == 1 && reader.matched() == 1; })) << round;
    ASSERT_TRUE(writer.write({7, ControlVerb::pause, "x"}));
    Control control;
    ASSERT_TRUE(until(*second, [&] { return reader.take(control) == Take::sample; })) << round;
    EXPECT_EQ(control.verb, ControlVerb::pause);
    EXPECT_EQ(control.number, 7U);
  }
}

TEST_P(WireOpen, one_process_has_buses_of_several_empty_domains) {
  const test::TestDomain second_domain, third_domain;
  const auto first = open_bus(config()), second = open_bus(config_of(GetParam(), second_domain.number()));
  const auto third = open_bus(config_of(GetParam(), third_domain.number()));
  EXPECT_NE(third->effective_settings().find("domain=" + third_domain.text()), std::string::npos);
}

TEST_P(WireOpen, a_wait_without_news_ends_and_a_wake_up_before_it_is_not_lost) {
  const auto bus = open_bus(config());
  auto reader = bus->reader<Control>(own_);
  auto writer = bus->writer<Control>(own_);
  // The match happens while no thread waits.
  ASSERT_TRUE(until(*bus, [&] { return reader.matched() == 1; }));
  for (int news = 0; news < 20 && bus->wait(0.5); ++news) {
  }
  ASSERT_TRUE(writer.write({}));
  ASSERT_TRUE(writer.wait_for_acknowledgments(20.0));
  EXPECT_TRUE(bus->wait(20.0));
}

TEST_P(WireOpen, settings_say_where_they_come_from_and_flags_win) {
  EXPECT_NE(open_bus(config())->effective_settings().find("interface=127.0.0.1"), std::string::npos);
  auto changed = config();
  changed.interface_address = "localhost";
  changed.peers = {"127.0.0.3"};
  const std::string settings = open_bus(changed)->effective_settings();
  EXPECT_NE(settings.find("interface=127.0.0.1"), std::string::npos) << settings;
  EXPECT_NE(settings.find("peers=127.0.0.3"), std::string::npos) << settings;
  EXPECT_NE(settings.find(name_of(GetParam())), std::string::npos) << settings;
}

/// Settings with an interface that this machine does not have.
const char* foreign_interface(Vendor vendor) {
  if (vendor == Vendor::cyclonedds) {
    return R"(<?xml version="1.0"?>
<CycloneDDS><!-- <NetworkInterface address="127.0.0.1"/> --><Domain Id="any"><General>
<Interfaces><NetworkInterface address="192.0.2.1"/></Interfaces></General></Domain></CycloneDDS>)";
  }
  return R"(<?xml version="1.0"?>
<dds xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"><profiles>
<transport_descriptors><transport_descriptor><transport_id>udp</transport_id><type>UDPv4</type>
<interfaceWhiteList><address>192.0.2.1</address></interfaceWhiteList></transport_descriptor></transport_descriptors>
<participant profile_name="subworld"><rtps><userTransports><transport_id>udp</transport_id></userTransports>
<useBuiltinTransports>false</useBuiltinTransports></rtps></participant></profiles></dds>)";
}

TEST_P(WireOpen, a_flag_wins_over_the_settings_file) {
  auto given = config();
  given.qos_file = file("foreign.xml", foreign_interface(GetParam()));
  if (GetParam() == Vendor::cyclonedds) {
    expect_error(given, {"foreign.xml", "192.0.2.1"});
  } else {
    // Fast DDS opens, but without an interface.
    EXPECT_NE(open_bus(given)->effective_settings().find("interface=(settings)"), std::string::npos);
  }
  given.interface_address = "127.0.0.1";
  const auto bus = open_bus(given);
  EXPECT_NE(bus->effective_settings().find("interface=127.0.0.1"), std::string::npos) << bus->effective_settings();
  EXPECT_NE(bus->effective_settings().find("foreign.xml"), std::string::npos) << bus->effective_settings();
}

TEST_P(WireOpen, the_environment_is_between_the_flag_and_the_file_beside_the_program) {
  const char* variable = GetParam() == Vendor::fastdds ? "FASTRTPS_DEFAULT_PROFILES_FILE" : "CYCLONEDDS_URI";
  const std::string installed = std::filesystem::read_symlink("/proc/self/exe").parent_path() / "qos" /
                                (std::string(name_of(GetParam())) + ".xml");
  EXPECT_NE(open_bus(config())->effective_settings().find("settings=" + installed), std::string::npos);
  setenv(variable, installed.c_str(), 1);
  EXPECT_NE(open_bus(config())->effective_settings().find(std::string("settings=") + variable), std::string::npos);
  auto given = config();
  given.qos_file = installed;
  EXPECT_NE(open_bus(given)->effective_settings().find("settings=" + installed), std::string::npos);
  const std::string broken = file("broken.xml", "<CycloneDDS><Domain><General></Domain>");
  setenv(variable, broken.c_str(), 1);
  expect_error(config(), {"broken.xml"});
  unsetenv(variable);
}

TEST_P(WireOpen, a_discovery_server_of_the_environment_is_ignored_with_a_remark) {
  setenv("ROS_DISCOVERY_SERVER", "127.0.0.1:11811", 1);
  auto bus = open_bus(config());
  EXPECT_EQ(std::getenv("ROS_DISCOVERY_SERVER"), nullptr);
  EXPECT_NE(bus->effective_settings().find("ignored=ROS_DISCOVERY_SERVER"), std::string::npos);
  auto other = open_bus(config());
  auto writer = bus->writer<Control>(own_);
  const auto reader = other->reader<Control>(own_);
  EXPECT_TRUE(until(*bus, [&] { return writer.matched() == 1; }));
}

/// It ends: a writer that waited for acknowledgements would exceed the time of this test.
TEST_P(WireOpen, closing_does_not_wait_for_readers_that_are_gone) {
  auto other = open_bus(config());
  auto bus = open_bus(config());
  auto writer = bus->writer<Control>(own_);
  auto reader = std::make_unique<Reader<Control>>(other->reader<Control>(own_));
  EXPECT_TRUE(until(*bus, [&] { return writer.matched() == 1 && reader->matched() == 1; }));
  for (int i = 0; i < 100; ++i) EXPECT_TRUE(writer.write({7, ControlVerb::set_engine, std::string(60'000, 'x')}));
  reader.reset();
  other.reset();
}

TEST_P(WireOpen, closing_does_not_wait_for_an_interface_that_has_vanished) {
  if (getuid() != 0) GTEST_SKIP() << "needs the rights of root";
  std::atomic<bool> closed = false;
  std::thread elsewhere([&] {
    ASSERT_EQ(unshare(CLONE_NEWNET), 0);
    ASSERT_EQ(std::system("ip link set lo up && ip link add left type veth peer name right && "
                          "ip address add 10.66.0.1/24 dev left && ip link set left up && ip link set right up && "
                          "until ip link show left | grep -q LOWER_UP; do sleep 0.02; done"),
              0);
    auto given = config();
    given.interface_address = "left";
    auto bus = open_bus(given);
    ASSERT_EQ(std::system("ip link delete left"), 0);
    bus.reset();
    closed = true;
  });
  EXPECT_TRUE(test::eventually([&] { return closed.load(); }, 30.0));
  if (closed) {
    elsewhere.join();
  } else {
    elsewhere.detach();
  }
}

TEST_P(WireOpen, leaves_nothing_in_shared_memory) {
  const auto count = [] {
    int files = 0;
    for (const auto& entry : std::filesystem::directory_iterator("/dev/shm")) {
      const std::string name = entry.path().filename().string();
      files += name.starts_with("fast") || name.starts_with("sem.fast") ? 1 : 0;
    }
    return files;
  };
  const int before = count();
  const auto bus = open_bus(config());
  auto writer = bus->writer<Control>(own_);
  EXPECT_EQ(count(), before);
}

INSTANTIATE_TEST_SUITE_P(Vendors, WireOpen, ::testing::Values(Vendor::fastdds, Vendor::cyclonedds),
                         [](const auto& test) { return std::string(name_of(test.param)); });

}  // namespace
}  // namespace subworld
