// The doctor's judgements, also of states that no test can bring about; and its page.
#include "doctor/checks.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <functional>
#include <iterator>
#include <set>

namespace subworld::doctor {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

RunningProgram program(const char* name, pid_t pid, std::vector<std::string> words) {
  RunningProgram made{.pid = pid, .name = name};
  made.words = std::move(words);
  made.domain = 70;
  made.age_s = 10.0;
  return made;
}

Status status_of(ProgramKind kind, const char* state) {
  Status status;
  status.program = kind;
  status.state = state;
  return status;
}

/// Two hosts and a run on domain 70, without a fault.
Facts healthy() {
  Facts facts;
  facts.request.domain = 70;
  facts.request.network.interface_address = "eth0";
  facts.request.network.peers = {"hostb"};
  facts.network.interfaces = {{.name = "lo", .address = "127.0.0.1", .loopback = true, .mtu = 65536},
                              {.name = "eth0", .address = "10.0.0.1"}};
  facts.network.peers = {{.host = "hostb", .address = "10.0.0.2", .route = "eth0"}};
  facts.machine.parts = {{.name = "world_sim", .version = "world_sim 0.1.0"},
                         {.name = "DDS fastdds", .version = "2.9.1"}};
  facts.domain.number = 70;
  facts.domain.worlds = 1;
  facts.domain.users = 1;
  facts.domain.scene = "press";
  facts.domain.free_domain = 100;
  facts.domain.statuses = {status_of(ProgramKind::world_sim, "running"), status_of(ProgramKind::haptic_sim, "running"),
                           status_of(ProgramKind::device_sim, "running")};
  const std::vector<std::string> flags{"--mode", "realtime", "--domain", "70", "--interface", "eth0"};
  for (const char* name : {"world_sim", "haptic_sim"}) {
    std::vector<std::string> words{std::string("bin/") + name, "press"};
    words.insert(words.end(), flags.begin(), flags.end());
    facts.domain.programs.push_back(program(name, name[0] == 'w' ? 11 : 12, words));
    facts.domain.programs.back().network.interface_address = "eth0";
  }
  return facts;
}

struct Fault {
  const char* check;
  std::function<void(Facts&)> make;
  const char* cure;  ///< a part of it
};

const std::vector<Fault>& faults() {
  static const std::vector<Fault> kAll{
      {"realtime_rights", [](Facts& f) { f.machine.fifo = false; }, "prlimit --pid $$ --rtprio=80"},
      {"realtime_rights", [](Facts& f) { f.machine.fifo = f.machine.may_raise_limits = false; }, "--ulimit rtprio=80"},
      {"memory_lock", [](Facts& f) { f.machine.locks_memory = false; }, "prlimit --pid $$ --memlock=unlimited"},
      {"realtime_throttling", [](Facts& f) { f.machine.real_time_runtime_us = 500'000; },
       "sysctl -w kernel.sched_rt_runtime_us=950000"},
      {"cores", [](Facts& f) { f.machine.allowed_cores = 1, f.machine.cores = 8; }, "taskset --cpu-list --pid 0-7 $$"},
      {"cpu_quota",
       [](Facts& f) {
         f.machine.quota = {0.3, "/sys/fs/cgroup/cpu.max"};
       },
       "echo max | tee /sys/fs"},
      {"cpu_quota",
       [](Facts& f) {
         f.machine.quota = {0.3, "/sys/fs/cgroup/cpu.max"};
       },
       "echo max | tee /sys/fs"},
      {"governor", [](Facts& f) { f.machine.governor = "powersave", f.machine.governor_driver = "acpi-cpufreq"; },
       "scaling_governor"},
      {"lateness", [](Facts& f) { f.machine.lateness_p99_s = 0.8e-3; }, "ps -eo"},
      {"shared_memory", [](Facts& f) { f.machine.shared_memory = {"/dev/shm/fastrtps_a"}; },
       "rm -f -- /dev/shm/fastrtps_a"},
      {"temporary_folder", [](Facts& f) { f.machine.bad_temporary_folder = "/tmp"; }, "mkdir -p /tmp"},
      {"installation",
       [](Facts& f) { f.machine.parts[1] = {.name = "DDS fastdds", .fault = "not found", .cure = "deploy/build"}; },
       "deploy/build"},
      {"interface",
       [](Facts& f) {
         f.request.network = {}, f.network.peers.clear();
         f.network.interfaces[0].up = f.network.interfaces[0].running = false;
         f.domain.programs.clear();
       },
       "ip link set lo up"},
      {"interface", [](Facts& f) { f.request.network.interface_address.clear(), f.domain.programs.clear(); },
       "subworld doctor --domain 70 --interface eth0 --peers hostb"},
      {"interface", [](Facts& f) { f.request.network.interface_address = "eth9", f.domain.programs.clear(); },
       "--interface eth0"},
      {"interface", [](Facts& f) { f.network.interfaces[1].up = f.network.interfaces[1].running = false; },
       "ip link set eth0 up"},
      {"interface", [](Facts& f) { f.network.interfaces[1].running = false; }, "ip monitor link dev eth0"},
      {"interface", [](Facts& f) { f.network.interfaces[1].address.clear(); }, "ip address add 10.0.0.6/24 dev eth0"},
      {"peer_names",
       [](Facts& f) {
         f.network.peers[0] = {.host = "hostbb", .fault = "unknown"}, f.request.network.peers = {"hostbb", "hostb"};
       },
       "--peers hostb"},
      {"route", [](Facts& f) { f.network.peers[0].route = ""; }, "ip route replace 10.0.0.2/32 dev eth0"},
      {"peer_present",
       [](Facts& f) {
         Peer& peer = f.network.peers[0];
         peer.neighbour_absent = true, peer.refuses = peer.refuses_full_size = false;
       },
       "ip -brief address"},
      {"firewall", [](Facts& f) { f.network.peers[0].refuses = f.network.peers[0].refuses_full_size = false; },
       "udp dport 24900-25149 accept"},
      {"path_mtu", [](Facts& f) { f.network.peers[0].refuses_full_size = false, f.network.interfaces[1].mtu = 9000; },
       "ip link set eth0 mtu 1500"},
      {"keys",
       [](Facts& f) {
         f.request.network.secure = "keys", f.network.key_faults = {"world_sim: certificate.pem has expired"};
       },
       "subworld keys make 'keys_new' --users 1"},
      {"joining", [](Facts& f) { f.domain.fault = "ports in use"; }, "--domain 100"},
      {"joining", [](Facts& f) { f.domain.fault = "QoS file no.xml: none", f.request.network.qos_file = "no.xml"; },
       "subworld doctor --domain 70 --interface eth0 --peers hostb"},
      {"variable_names",
       [](Facts& f) {
         f.machine.environment = {{"SUBWORLD_PLACEMNT", "none"}};
       },
       "export SUBWORLD_PLACEMENT='none'"},
      {"vendor_variables",
       [](Facts& f) {
         f.machine.environment = {{"FASTRTPS_DEFAULT_PROFILES_FILE", "x.xml"}};
       },
       "unset FASTRTPS_DEFAULT_PROFILES_FILE"},
      {"vendor_variables",
       [](Facts& f) {
         f.machine.environment = {{"ROS_DISCOVERY_SERVER", "127.0.0.1:11811"}};
       },
       "unset ROS_DISCOVERY_SERVER"},
      {"socket_buffers", [](Facts& f) { f.machine.receive_buffer_bytes = 212'992; },
       "sysctl -w net.core.rmem_max=4194304"},
      {"socket_buffers", [](Facts& f) { f.machine.send_buffer_bytes = 212'992; },
       "sysctl -w net.core.wmem_max=1048576"},
      {"peers_are_others", [](Facts& f) { f.network.peers[0].own = true; },
       "subworld doctor --domain 70 --interface eth0"},
      {"ephemeral_ports",
       [](Facts& f) {
         f.machine.ephemeral_ports = {10'000, 60'999};
       },
       "ip_local_port_range='32768 60999'"},
      {"foreign_ports", [](Facts& f) { f.domain.foreign_ports = {{.port = 24'910, .pid = 8, .name = "talker"}}; },
       "--domain 100"},
      {"ros_domain",
       [](Facts& f) {
         f.machine.environment = {{"ROS_DOMAIN_ID", "70"}};
       },
       "--domain 100"},
      {"suspended", [](Facts& f) { f.domain.programs[1].suspended = true; }, "kill -CONT 12"},
      {"replaced", [](Facts& f) { f.domain.programs[0].file_replaced = true; }, "kill 11"},
      {"worlds", [](Facts& f) { f.domain.worlds = 2; }, "subworld control stop --domain 70"},
      {"strayed", [](Facts& f) { f.domain.programs[1].domain = 0; },
       "kill 12; bin/haptic_sim press --mode realtime --domain 70 --interface eth0 --user 0"},
      {"flags", [](Facts& f) { f.domain.programs[1].words[3] = "lockstep"; },
       "kill 12; bin/haptic_sim press --mode realtime --domain 70 --interface eth0 --user 0"},
      {"interfaces", [](Facts& f) { f.domain.programs[1].network.interface_address = ""; },
       "kill 12; bin/haptic_sim press --mode realtime --domain 70 --interface eth0 --user 0"},
      {"first_samples", [](Facts& f) { f.domain.statuses.pop_back(), f.domain.statuses[0].state = "waiting"; },
       "bin/device_sim press --mode realtime --domain 70 --interface eth0 --user 0"},
      {"incompatible_qos",
       [](Facts& f) { f.domain.statuses[0].events.incompatible_qos = 2, f.domain.statuses[0].state = "waiting"; },
       "subworld control stop --domain 70"}};
  return kAll;
}

std::string text_of(const std::vector<Finding>& findings) {
  std::string text;
  for (const Finding& one : findings) text += one.check + ": " + one.what + "; " + one.cure + "\n";
  return text;
}

TEST(DoctorChecks, AreSilentOnAHealthySystem) {
  EXPECT_EQ(text_of(judge(healthy())), "");
  Facts alone;
  alone.machine.parts.clear();
  EXPECT_EQ(text_of(judge(alone)), "");
}

TEST(DoctorChecks, EachFaultHasOneFindingWithItsCure) {
  std::set<std::string> seen;
  for (const Fault& fault : faults()) {
    Facts facts = healthy();
    fault.make(facts);
    const std::vector<Finding> findings = judge(facts);
    ASSERT_EQ(findings.size(), 1U) << fault.check << "\n" << text_of(findings);
    EXPECT_EQ(findings[0].check, fault.check) << text_of(findings);
    EXPECT_THAT(findings[0].cure, HasSubstr(fault.cure)) << fault.check;
    EXPECT_FALSE(findings[0].what.empty() || findings[0].why.empty()) << fault.check;
    seen.insert(fault.check);
  }
  for (const Check& check : checks()) EXPECT_TRUE(seen.contains(check.name)) << check.name << " has no fault here";
}

// It may belong to another run, which is yet to begin.
TEST(DoctorChecks, AProgramWhoseRoleIsTakenHasNotStrayed) {
  Facts facts = healthy();
  facts.domain.programs.push_back(facts.domain.programs[1]);
  facts.domain.programs.back().pid = 20;
  facts.domain.programs.back().domain = 0;
  EXPECT_EQ(text_of(judge(facts)), "");
}

TEST(DoctorChecks, ACommandForRootSaysSo) {
  Facts facts = healthy();
  facts.machine.root = false;
  facts.network.interfaces[1].up = facts.network.interfaces[1].running = false;
  EXPECT_THAT(text_of(judge(facts)), HasSubstr("sudo ip link set eth0 up"));
}

TEST(DoctorChecks, OfOneHostTheUsualBuffersAreEnough) {
  Facts facts = healthy();
  facts.request.network = {};
  facts.network.peers.clear();
  facts.domain = {};
  facts.machine.receive_buffer_bytes = facts.machine.send_buffer_bytes = 212'992;
  EXPECT_EQ(text_of(judge(facts)), "");
}

TEST(DoctorChecks, LockstepNeedsNoRightsOfRealTime) {
  Facts facts = healthy();
  facts.needs.realtime = facts.machine.fifo = facts.machine.locks_memory = false;
  facts.machine.lateness_p99_s = 0.1;
  EXPECT_EQ(text_of(judge(facts)), "");
}

TEST(DoctorPage, ListsEveryCheckInItsOwnWords) {
  std::ifstream file(SOURCE_FOLDER "/deploy/doctor/README.md");
  const std::string page(std::istreambuf_iterator<char>(file), {});
  std::string rows;
  for (const Check& check : checks()) rows += std::string("| `") + check.name + "` | " + check.about + " |\n";
  EXPECT_THAT(page, HasSubstr(rows)) << "the table of deploy/doctor/README.md has to be:\n" << rows;
}

TEST(Doctor, OneCommandRaisesAllLimits) {
  for (const bool container : {false, true}) {
    Facts facts = healthy();
    facts.machine.fifo = facts.machine.locks_memory = false;
    facts.machine.may_raise_limits = !container;
    const std::vector<Finding> found = judge(facts);
    ASSERT_EQ(found.size(), 2U);
    EXPECT_EQ(found[0].cure, found[1].cure);
    EXPECT_THAT(found[0].cure, HasSubstr(container ? "--ulimit rtprio=80 --ulimit memlock=-1"
                                                   : "prlimit --pid $$ --rtprio=80 --memlock=unlimited"));
  }
}

}  // namespace
}  // namespace subworld::doctor
