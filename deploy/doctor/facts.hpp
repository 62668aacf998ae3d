#pragma once

#include "model/messages/exchange.hpp"
#include "model/settings/network.hpp"
#include "rt/kernel_share.hpp"
#include "watch/programs.hpp"
#include "wire/plugin.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

/// What `subworld doctor` reads. Reading (read_*.cpp) is separate from judging (checks.hpp), so that every judgement
/// has a test, also of a state that a test cannot bring about.
namespace subworld::doctor {

/// The command line of `subworld doctor`. Without --domain, --interface and --peers, those of the run on this machine.
struct Request {
  Network network = {};
  std::string dds = "fastdds";  ///< or mixed
  std::optional<int> domain = {};
  std::string scene = {};  ///< empty: none
};

/// What a scene needs; without one, a run with one user.
struct Needs {
  int users = 1;
  bool realtime = true;
  std::vector<std::string> engines = {};
};

/// A part of Subworld that a run needs.
struct InstalledPart {
  std::string name = {};     ///< "world_sim", "DDS fastdds", "engine bullet"
  std::string version = {};  ///< empty: it is missing or cannot be used
  std::string fault = {}, cure = {};
};

struct Machine {
  bool root = true;              ///< effective user
  bool may_raise_limits = true;  ///< as root: a container may have taken the right (CAP_SYS_RESOURCE)
  bool fifo = true;              ///< SCHED_FIFO at the priority of the haptic loops was granted
  bool locks_memory = true;
  int cores = 2, allowed_cores = 2;
  std::optional<CpuQuota> quota = {};
  std::string governor, governor_driver;  ///< empty: the kernel has none
  std::int64_t real_time_runtime_us = 950'000, real_time_period_us = 1'000'000;
  double lateness_p99_s = 0.0, lateness_max_s = 0.0;  ///< of bare loops at 1 kHz
  std::vector<std::string> shared_memory = {};        ///< files that ended programs of Fast DDS have left
  std::string bad_temporary_folder = {};              ///< empty: it is there and can be written
  std::vector<std::pair<std::string, std::string>> environment = {};  ///< of Subworld, ROS and the DDS vendors, TMPDIR
  std::vector<InstalledPart> parts = {};
  std::int64_t receive_buffer_bytes = 4 << 20, send_buffer_bytes = 4 << 20;  ///< largest that a socket can have
  std::pair<int, int> ephemeral_ports{32768, 60999};
};

struct Interface {
  std::string name = {};
  std::string address = {};  ///< IPv4; empty: it has none
  bool up = true, running = true, loopback = false;
  int mtu = 1500;
};

/// How far a host answered.
struct Peer {
  std::string host = {};          ///< as given
  std::string address = {};       ///< IPv4; empty: the name does not resolve
  std::string fault = {};         ///< of the name
  bool own = false;               ///< an address of this machine
  std::string route = {};         ///< own interface by which messages leave for it; empty: there is no route
  bool neighbour_absent = false;  ///< on the same network, and the address is not in use
  bool refuses = true;            ///< an unused port of the domain answers that it is closed: nothing filters it
  bool refuses_full_size = true;  ///< also a datagram as long as the MTU of the interface
};

struct NetworkFacts {
  std::vector<Interface> interfaces = {};
  std::vector<Peer> peers = {};
  std::vector<std::string> key_faults = {};  ///< of --secure
  int keys_of_users = 0;                     ///< in its folder
};

/// A port of the domain that another program has.
struct ForeignPort {
  int port = 0;
  pid_t pid = 0;  ///< 0: unknown
  std::string name = {};
};

/// What was received on the domain, and what runs there on this machine.
struct Domain {
  std::optional<int> number = {};  ///< none: neither given nor in use
  std::string fault = {};          ///< of joining it; empty: none
  std::vector<Status> statuses = {};
  int worlds = 0;  ///< alive writers of the topic `scene`
  std::optional<std::uint32_t> users = {};
  std::string scene = {};                     ///< name
  std::vector<RunningProgram> programs = {};  ///< of this machine, on all domains
  std::vector<ForeignPort> foreign_ports = {};
  int free_domain = 0;  ///< one that no run or program uses
};

struct Facts {
  Request request = {};
  Needs needs = {};
  Machine machine = {};
  NetworkFacts network = {};
  Domain domain = {};
};

/// Reads all of it, in two to four seconds. Throws `Error` (usage) where the scene is wrong.
[[nodiscard]] Facts read_facts(const Request& request);

/// Parts of read_facts().
void read_machine(const Request& request, const Needs& needs, Machine& machine);
void read_network(const Request& request, NetworkFacts& network);
void probe_peers(const Request& request, int domain, NetworkFacts& network);

/// The interface that the command line names; null: none is named or found.
[[nodiscard]] const Interface* own_interface(const Request& request, const NetworkFacts& network);

}  // namespace subworld::doctor
