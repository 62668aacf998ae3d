#include "process/faults/doctor_cases.hpp"

#include <unistd.h>

#include <sstream>

namespace subworld::test {

namespace {

constexpr const char* kFunctions = R"shell(
namespace_of() { readlink /proc/$1/ns/net; }
host_b() {
  unshare --net sleep 600 & B=$!
  until [ "$(namespace_of $B)" != "$(namespace_of self)" ] && [ -n "$(namespace_of $B)" ]; do sleep 0.02; done
  ip link add eth0 type veth peer name eth1
  ip link set eth1 netns $B
  ip address add 10.77.0.1/24 dev eth0
  ip link set eth0 up
  on_b ip address add 10.77.0.2/24 dev eth1
  on_b ip link set eth1 up
  on_b ip link set lo up
  until ip link show eth0 | grep -q LOWER_UP; do sleep 0.02; done
}
on_b() { nsenter --net=/proc/$B/ns/net "$@"; }
start() {
  local log=$(mktemp -p $WORK $(basename $1).XXXXXX)
  "$@" >> $log 2>&1 &
  until grep -q 'dds=' $log; do sleep 0.05; done
}
)shell";

std::string on_two_hosts(const std::string& more = "") {
  return "--domain 70 --interface eth0 --peers 10.77.0.2" + more;
}

std::vector<Misconfiguration> of_the_machine() {
  return {
      {"NoRealtimeRights", "realtime_rights", "", "", "setpriv --bounding-set -sys_nice --inh-caps -sys_nice"},
      {"NoMemoryLock", "memory_lock", "", "", "setpriv --bounding-set -ipc_lock --inh-caps -ipc_lock"},
      {"OneCore", "cores", "", "", "taskset --cpu-list 0"},
      {"LeftSharedMemory", "shared_memory",
       "touch /dev/shm/fastrtps_1a2b3c4d /dev/shm/fastrtps_1a2b3c4d_el /dev/shm/sem.fastrtps_port7412_mutex; "
       "exec 9> /dev/shm/fastrtps_of_a_living_process; touch /dev/shm/fastrtps_locked; "
       "exec 8> /dev/shm/fastrtps_locked_el; flock --exclusive 8",
       ""},
  };
}

std::vector<Misconfiguration> of_the_environment() {
  return {
      {"NoTemporaryFolder", "temporary_folder", "export TMPDIR=/nowhere", ""},
      {"APluginFolderWithoutPlugins", "installation", "export SUBWORLD_PLUGIN_DIR=/nowhere", ""},
      {"AnEngineThatCannotBeLoaded", "installation",
       "mkdir $WORK/engines; cp $BROKEN/libsubworld_engine_broken.so $WORK/engines/libsubworld_engine_bullet.so; "
       "export SUBWORLD_ENGINES=$WORK/engines",
       "press"},
      {"AMisspeltVariable", "variable_names", "export SUBWORLD_DOMIAN=70", ""},
      {"SettingsOfFastDdsFromElsewhere", "vendor_variables",
       "export FASTRTPS_DEFAULT_PROFILES_FILE=$SOURCE/deploy/qos/fastdds.xml", ""},
      {"SettingsOfCycloneDdsFromElsewhere", "vendor_variables",
       "export CYCLONEDDS_URI=file://$SOURCE/deploy/qos/cyclonedds.xml", "--dds cyclonedds"},
      {"ADiscoveryServerOfRos", "vendor_variables", "export ROS_DISCOVERY_SERVER=127.0.0.1:11811", ""},
      {"AQosFileThatIsNotThere", "joining", "", "--qos $WORK/none.xml"},
      {"AQosFileThatFastDdsRefuses", "joining", "echo '<dds><profiles>' > $WORK/half.xml", "--qos $WORK/half.xml"},
      {"AQosFileThatCycloneDdsRefuses", "joining", "echo '<CycloneDDS><Domain><Wrong/>' > $WORK/half.xml",
       "--dds cyclonedds --qos $WORK/half.xml"},
      {"TheDomainOfRos", "ros_domain", "export ROS_DOMAIN_ID=70", "--domain 70"},
  };
}

std::vector<Misconfiguration> of_the_network() {
  return {
      {"LoopbackIsDown", "interface", "ip link set lo down", ""},
      {"PeersWithoutInterface", "interface", "host_b", "--domain 70 --peers 10.77.0.2"},
      {"PeersOnLoopback", "interface", "host_b", "--domain 70 --interface lo --peers 10.77.0.2"},
      {"AMisspeltInterface", "interface", "host_b", "--domain 70 --interface eth --peers 10.77.0.2"},
      {"AnInterfaceThatIsDown", "interface", "host_b; ip link set eth0 down", on_two_hosts()},
      {"ACableThatIsUnplugged", "interface",
       "host_b; on_b ip link set eth1 down; until ip link show eth0 | grep -q NO-CARRIER; do sleep 0.02; done",
       on_two_hosts(), "", "on_b ip link set eth1 up; until ip link show eth0 | grep -q LOWER_UP; do sleep 0.02; done"},
      {"AnInterfaceWithoutAddress", "interface", "host_b; ip address flush dev eth0", on_two_hosts()},
      {"AMtuThatThePeerLacks", "path_mtu", "host_b; ip link set eth0 mtu 9000", on_two_hosts()},
      {"AnUnknownPeer", "peer_names", "host_b", "--domain 70 --interface eth0 --peers unknown.invalid,10.77.0.2"},
      {"ThePeerIsThisHost", "peers_are_others", "host_b", "--domain 70 --interface eth0 --peers 10.77.0.1"},
      {"NoRoute", "route", "host_b; on_b ip address add 10.99.0.2/24 dev eth1; on_b ip route add 10.77.0.1/32 dev eth1",
       "--domain 70 --interface eth0 --peers 10.99.0.2"},
      {"ARouteThroughAnotherInterface", "route",
       "host_b; ip link add other0 type veth peer name other1; ip address add 10.88.0.1/24 dev other0; "
       "ip link set other1 up; ip link set other0 up; ip route add 10.77.0.2/32 dev other0",
       on_two_hosts()},
      {"AnAddressWithoutAHost", "peer_present", "host_b; on_b ip address flush dev eth1", on_two_hosts(), "",
       "on_b ip address add 10.77.0.2/24 dev eth1"},
      {"AFirewallForUdp", "firewall",
       "host_b; on_b ip rule add pref 10 lookup local; on_b ip rule delete pref 0 lookup local; "
       "on_b ip rule add pref 5 ipproto udp dport 24900-25149 blackhole",
       on_two_hosts(), "", "on_b ip rule delete pref 5"},
      {"AFirewallForAll", "firewall", "host_b; on_b ip route add blackhole 10.77.0.1/32", on_two_hosts(), "",
       "on_b ip route delete blackhole 10.77.0.1/32"},
      {"PortsThatLinuxGivesAway", "ephemeral_ports", "sysctl -qw net.ipv4.ip_local_port_range='20000 60999'", ""},
      {"ADomainAmongPortsThatLinuxGivesAway", "ephemeral_ports", "", "--domain 180"},
      {"APortOfAnotherProgram", "foreign_ports",
       "hostile_peer fastdds 70 realtime second_world & until grep -q ':61[45]' /proc/net/udp; do sleep 0.02; "
       "done",
       "--domain 70"},
  };
}

std::vector<Misconfiguration> of_a_run() {
  const std::string world = "start $BIN/world_sim press --duration 600 --mode realtime --domain 70; ";
  return {
      {"ASuspendedProgram", "suspended",
       world + "start $BIN/haptic_sim press --duration 600 --mode realtime --domain 70; start $BIN/device_sim press "
               "--duration 600 --mode realtime "
               "--domain 70; kill -STOP $!",
       "--domain 70"},
      {"AProgramThatWasReplaced", "replaced",
       "mkdir $WORK/bin; cp -r $BIN/world_sim $BIN/qos $WORK/bin; ln -s $BIN/lib*.so $WORK/bin; "
       "start $WORK/bin/world_sim $SOURCE/deploy/scenes/press.yaml --duration 600 --mode realtime --domain 70; rm "
       "$WORK/bin/world_sim; "
       "start $BIN/haptic_sim press --duration 600 --mode realtime --domain 70; start $BIN/device_sim press --duration "
       "600 --mode realtime --domain 70",
       "--domain 70"},
      {"TwoWorlds", "worlds", world + world, "--domain 70", "", "", "first_samples first_samples"},
      {"AProgramOnAnotherDomain", "strayed",
       world + "start $BIN/device_sim press --duration 600 --mode realtime --domain 70; start $BIN/haptic_sim press "
               "--duration 600 --mode realtime",
       "--domain 70"},
      {"OtherFlagsThanTheWorld", "flags",
       world + "start $BIN/device_sim press --duration 600 --mode realtime --domain 70; "
               "start $BIN/haptic_sim press --duration 600 --mode lockstep --domain 70",
       "--domain 70"},
      {"ProgramsOnTwoInterfaces", "interfaces",
       "host_b; " + world +
           "start $BIN/device_sim press --duration 600 --mode realtime --domain 70; "
           "start $BIN/haptic_sim press --duration 600 --mode realtime --domain 70 --interface eth0",
       "--domain 70"},
      {"ARunWithoutADevice", "first_samples",
       world + "start $BIN/haptic_sim press --duration 600 --mode realtime --domain 70", "--domain 70"},
      {"ARunWithoutASubWorld", "first_samples",
       world + "start $BIN/device_sim press --duration 600 --mode realtime --domain 70", "--domain 70"},
      {"ProgramsWithoutAWorld", "first_samples",
       "start $BIN/haptic_sim press --duration 600 --mode realtime --domain 70; start $BIN/device_sim press --duration "
       "600 --mode realtime --domain 70",
       "--domain 70"},
  };
}

/// The value of a line "NAME: ..." of an output.
std::string value_in(const std::string& text, const std::string& name) {
  const std::size_t at = text.find("\n" + name + ": ");
  if (at == std::string::npos) return {};
  const std::size_t from = at + name.size() + 3;
  return text.substr(from, text.find('\n', from) - from);
}

/// The names of the checks that have findings; lateness depends on what else the machine does.
std::string found_in(const std::string& report) {
  std::string names;
  std::istringstream lines(report);
  for (std::string line; std::getline(lines, line);) {
    const std::string name = line.substr(0, line.find(':'));
    if (name.find_first_not_of("abcdefghijklmnopqrstuvwxyz_") != std::string::npos) continue;
    if (name != "lateness" && name != "healthy") names += (names.empty() ? "" : " ") + name;
  }
  return names;
}

}  // namespace

void PrintTo(const Misconfiguration& wrong, std::ostream* to) { *to << wrong.name; }

const std::vector<Misconfiguration>& misconfigurations() {
  static const std::vector<Misconfiguration> kAll = [] {
    std::vector<Misconfiguration> all;
    for (const auto& part : {of_the_machine(), of_the_environment(), of_the_network(), of_a_run()})
      all.insert(all.end(), part.begin(), part.end());
    return all;
  }();
  return kAll;
}

bool Doctor::has_namespaces() const {
  return getuid() == 0 &&
         finish({"/usr/bin/unshare", "--mount", "--net", "--pid", "--fork", "/bin/sh", "-c", "ip link set lo up"})
                 .code == 0;
}

Ended Doctor::run_apart(const std::string& code, const std::string& wrapper, const std::string& after) const {
  const std::string work = folder_.path() + "/scratch";
  std::filesystem::create_directories(work + "/tmp");
  std::filesystem::permissions(folder_.path(), std::filesystem::perms::all);
  std::filesystem::permissions(work, std::filesystem::perms::all);
  std::filesystem::permissions(work + "/tmp", std::filesystem::perms::all);
  const std::string inner = folder_.write("inner.sh", kFunctions + code);
  const std::string outer =
      "ip link set lo up\nmount -t tmpfs tmpfs /dev/shm\nunset SUBWORLD_PLACEMENT\n"
      "export TMPDIR=" +
      work + "/tmp WORK=" + work + " BIN=" + PROGRAMS_FOLDER + " SOURCE=" + SOURCE_FOLDER +
      " BROKEN=" + BROKEN_ENGINES_FOLDER + "\nexport PATH=$BIN:$PATH\ncd $WORK\n" + wrapper + " bash " + inner + "\n" +
      after + "\n";
  return finish({"/usr/bin/unshare", "--mount", "--net", "--pid", "--fork", "--mount-proc", "--kill-child",
                 "--propagation", "private", "/bin/bash", folder_.write("outer.sh", outer)});
}

void Doctor::expect_found_and_cured(const Misconfiguration& wrong) const {
  const std::string doctor = "subworld doctor " + wrong.arguments;
  std::string code = wrong.setup + "\nbegin=$(date +%s%N)\n" + doctor + " > $WORK/first.txt; first=$?\n" +
                     "end=$(date +%s%N)\n" + "cure=$(grep -A2 '^" + wrong.check +
                     ":' $WORK/first.txt | sed -n 's/^  cure: //p' | head -n 1)\n";
  code += "echo; echo code: $first; echo \"took_ms: $(((end - begin) / 1000000))\"; echo \"cure: $cure\"\n";
  if (!wrong.instead_of_cure.empty()) {
    code += wrong.instead_of_cure + "\n" + doctor + " > $WORK/second.txt\n";
  } else {
    // A cure that starts a program is typed in a terminal of its own. One that is `exit` continues outside.
    code +=
        "case \"$cure\" in 'subworld doctor'*) eval \"$cure\" > $WORK/second.txt;;\n"
        "  *_sim*) eval \"{ $cure; } > $WORK/cure.log 2>&1 &\"; sleep 1; " +
        doctor +
        " > $WORK/second.txt;;\n"
        "  *) eval \"$cure\" > $WORK/cure.log 2>&1; sleep 0.2; " +
        doctor + " > $WORK/second.txt;;\nesac\n";
  }
  const Ended ended = run_apart(code, wrong.wrapper, "[ -e $WORK/second.txt ] || " + doctor + " > $WORK/second.txt");
  const std::string work = folder_.path() + "/scratch/";
  const std::string first = read_text(work + "first.txt"), second = read_text(work + "second.txt");
  EXPECT_EQ(found_in(first), wrong.check) << first << ended.out << ended.err;
  EXPECT_EQ(value_in(ended.out, "code"), "4") << first;
  EXPECT_NE(first.find("\n  why:  "), std::string::npos) << first;
  EXPECT_FALSE(value_in(ended.out, "cure").empty()) << first;
  EXPECT_NE(second.find("checks passed"), std::string::npos) << second << ended.err;
  EXPECT_EQ(found_in(second), wrong.left)
      << "after the cure: " << second << read_text(work + "cure.log") << first << ended.err;
  RecordProperty("took_ms", value_in(ended.out, "took_ms"));
  std::printf("%s: %s, %s ms; cure: %s\n", wrong.name.c_str(), wrong.check.c_str(),
              value_in(ended.out, "took_ms").c_str(), value_in(ended.out, "cure").c_str());
}

}  // namespace subworld::test
