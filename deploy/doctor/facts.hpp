#pragma once

#include "model/exchange.hpp"
#include "model/network.hpp"
#include "watch/programs.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

/// What `subworld doctor` reads. Reading (read_*.cpp) is separate from judging (checks.hpp), so that every judgement
/// has a test, also of a state that a test cannot bring about.
namespace subworld::doctor {

/// The command line of `subworld doctor`. Without --domain, domain and interface are those of the run on this machine.
struct Request {
  Network network = {};
  std::string dds = "fastdds";  ///< or mixed
  std::optional<int> domain = {};
  std::string scene = {};  ///< empty: none
  std::string out = {};    ///< empty: not given
  bool verbose = false;
  bool json = false;
};

/// The most that the kernel grants to this process.
struct Limit {
  std::uint64_t soft = kUnlimited;
  std::uint64_t hard = kUnlimited;
  static constexpr std::uint64_t kUnlimited = ~std::uint64_t{0};
};

/// A program of another kind that runs with a real-time priority.
struct Rival {
  pid_t pid = 0;
  std::string name = {};
  int priority = 0;
  double cores = 0.0;  ///< mean number of cores in use while it was watched
};

/// A file of shared memory or a lock.
struct LeftFile {
  std::string path = {};
  bool in_use = false;   ///< a process has it open or mapped
  bool can_open = true;  ///< for reading and writing
};

struct InstalledPart {
  std::string name = {};     ///< "world_sim", "DDS fastdds", "engine bullet"
  std::string version = {};  ///< empty: it is missing or cannot be used
  std::string fault = {};
};

struct Machine {
  bool root = true;              ///< effective user
  bool may_raise_limits = true;  ///< as root: a container may have taken the right (CAP_SYS_RESOURCE)
  bool fifo = true;              ///< SCHED_FIFO at the priority of the haptic loops was granted
  bool locks_memory = true;
  Limit memory_lock, real_time_priority, open_files, processes;
  bool process_limit_holds = false;  ///< the kernel exempts the user root
  int own_threads = 0;               ///< of all processes of this user
  int cores = 2, allowed_cores = 2;
  std::string governor, governor_driver;  ///< empty: the kernel has none
  std::int64_t real_time_runtime_us = 950'000, real_time_period_us = 1'000'000;
  double period_s = 0.001;  ///< of the bare loops
  double lateness_p99_s = 0.0, lateness_max_s = 0.0;
  std::uint64_t wake_ups = 0, late_wake_ups = 0;  ///< of the bare loops; later than a period
  std::vector<Rival> rivals = {};
  std::vector<LeftFile> shared_memory = {};  ///< of a DDS vendor
  std::vector<LeftFile> lock_files = {};     ///< of Subworld
  std::string temporary_folder = {};         ///< as the environment or the system says
  bool temporary_folder_usable = true;
  std::string out = {};           ///< folder of the results
  std::string out_existing = {};  ///< its nearest folder that exists
  bool out_writable = true;
  bool out_is_folder = true;
  std::uint64_t out_free_bytes = ~std::uint64_t{0};
  std::vector<std::pair<std::string, std::string>> environment =
      {};  ///< variables of Subworld, ROS and the DDS vendors
  std::vector<InstalledPart> parts = {};
  std::uint64_t receive_buffer_bytes = 4U << 20U, send_buffer_bytes = 4U << 20U;  ///< largest that a socket can have
  std::pair<int, int> ephemeral_ports{32768, 60999};
};

struct Interface {
  std::string name = {};
  std::string address = {};  ///< IPv4; empty: it has none
  bool up = true, running = true, loopback = false, multicast = true;
  int mtu = 1500;
};

/// How far a host answered.
struct Peer {
  std::string host = {};          ///< as given
  std::string address = {};       ///< IPv4; empty: the name does not resolve
  std::string fault = {};         ///< of the name
  bool own = false;               ///< an address of this machine
  std::string source = {};        ///< own address that the kernel chooses for it; empty: there is no route
  std::string route = {};         ///< own interface with that address
  bool neighbour_absent = false;  ///< on the same network, and the address is not in use
  bool pings = true;
  bool pings_full_size = true;  ///< with datagrams as long as the MTU of the interface
  bool ports_refuse = true;     ///< unused ports of the domain answer that they are closed: nothing filters them
  std::optional<double> clock_offset_s = {};  ///< its clock minus this one (ICMP time stamps)
  double clock_uncertainty_s = 0.0;
};

struct NetworkFacts {
  std::vector<Interface> interfaces = {};
  std::vector<Peer> peers = {};
  std::vector<std::string> known_hosts = {};  ///< of /etc/hosts
  std::string qos_fault = {};                 ///< what is wrong with --qos; empty: nothing
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
  bool opened = true;
  std::string fault = {};  ///< of joining it
  std::vector<Status> statuses = {};
  int worlds = 0;  ///< alive writers of the topic `scene`
  std::optional<std::uint32_t> users = {};
  std::string scene = {};                                    ///< name
  std::vector<RunningProgram> programs = {};                 ///< of this machine, on all domains
  std::vector<std::pair<pid_t, std::string>> versions = {};  ///< of programs from another folder
  std::vector<ForeignPort> foreign_ports = {};
  std::vector<int> free_domains = {};  ///< a few that no run or program uses
};

/// What a scene needs; without one, a run with one user.
struct Needs {
  int users = 1;
  bool realtime = true;
  std::vector<std::string> engines = {};
};

struct Facts {
  Request request = {};
  Machine machine = {};
  NetworkFacts network = {};
  Domain domain = {};
  Needs needs = {};
};

/// Reads all of it, in at most three seconds. Throws `Error` (usage) where the scene is wrong.
[[nodiscard]] Facts read_facts(const Request& request);

/// Parts of read_facts(). `domain.programs` are known before.
void read_machine(const Request& request, const Needs& needs, Machine& machine);
void read_network(const Request& request, NetworkFacts& network);
void probe_peers(const Request& request, int domain, NetworkFacts& network);
void read_domain(const Request& request, const NetworkFacts& network, Domain& domain);

}  // namespace subworld::doctor
