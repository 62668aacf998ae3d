#pragma once

#include "model/joined.hpp"
#include "wire/held_samples.hpp"
#include "wire/peer_program.hpp"
#include "wire/topics.hpp"

#include <fmt/core.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <iterator>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

/// Interface between the bus and a back end, one plug-in library per vendor. A back end moves CDR bytes and knows no
/// type: the key of a sample is the first words of its bytes.
namespace subworld::wire {

enum class Event : std::uint8_t {
  matched,
  unmatched,
  deadline_missed,
  liveliness_lost,
  incompatible_qos,
  lost,
  rejected,
  refused,
};

/// Called from the vendor's threads.
class EventSink {
 public:
  virtual ~EventSink() = default;
  /// `side` is "reader" or "writer"; `detail` is the policy, the reason or empty.
  virtual void report(Event event, std::uint64_t count, const char* side, const char* topic,
                      const char* detail) noexcept = 0;
  /// Called for new data, and for a writer that is alive again.
  virtual void wake() noexcept = 0;
};

struct EndpointSpec {
  TopicSpec topic;
  Qos qos;
  std::string partition;           ///< empty: the default one
  std::optional<Transit> transit;  ///< of a reader's samples
  EventSink* events = nullptr;     ///< instead of that of the back end

  [[nodiscard]] EventSink& events_or(EventSink& usual) const noexcept { return events != nullptr ? *events : usual; }
};

/// In place of a topic: a program that did not prove its role.
inline constexpr const char* kParticipant = "participant";
inline constexpr const char* kUnknownKey = "for a user or a program that does not exist";
inline constexpr std::uint32_t kPartitionPolicy = 10;
/// Policy ids of the DDS specification, used by both vendors.
constexpr const char* policy_name(std::uint32_t id) noexcept {
  constexpr const char* kNames[] = {"unknown policy",   "USERDATA",        "DURABILITY",     "PRESENTATION",
                                    "DEADLINE",         "LATENCYBUDGET",   "OWNERSHIP",      "OWNERSHIPSTRENGTH",
                                    "LIVELINESS",       "TIMEBASEDFILTER", "PARTITION",      "RELIABILITY",
                                    "DESTINATIONORDER", "HISTORY",         "RESOURCELIMITS", "ENTITYFACTORY"};
  return id < std::size(kNames) ? kNames[id] : kNames[0];
}

/// What readers and writers share. The vendors' threads call the protected functions with the statuses of the DDS
/// specification, whose fields have the same names in both vendors.
class Endpoint {
 public:
  virtual ~Endpoint() = default;
  Endpoint(const Endpoint&) = delete;
  Endpoint& operator=(const Endpoint&) = delete;
  [[nodiscard]] int matched() const noexcept { return matched_; }

 protected:
  Endpoint(const char* side, const char* topic, EventSink& events) : events_(events), side_(side), topic_(topic) {}
  void match(const auto& status) noexcept {
    matched_ = static_cast<int>(status.current_count);
    const auto change = status.current_count_change;
    report(change > 0 ? Event::matched : Event::unmatched, std::abs(change), "");
  }
  void miss_deadline(const auto& status) noexcept { report(Event::deadline_missed, status.total_count_change, ""); }
  void differ(const auto& status) noexcept {
    report(Event::incompatible_qos, status.total_count_change,
           policy_name(static_cast<std::uint32_t>(status.last_policy_id)));
  }
  void report(Event event, std::int64_t count, const char* detail) noexcept {
    if (count > 0) events_.report(event, static_cast<std::uint64_t>(count), side_, topic_, detail);
  }

  EventSink& events_;

 private:
  const char* side_;
  const char* topic_;
  std::atomic<int> matched_ = 0;
};

class BackendWriter : public Endpoint {
 public:
  /// False if the sample was not accepted.
  virtual bool write(std::span<const std::uint8_t> cdr) noexcept = 0;
  virtual bool wait_for_acknowledgments(double timeout_s) noexcept = 0;

 protected:
  BackendWriter(const char* topic, EventSink& events) : Endpoint("writer", topic, events) {}
};

class BackendReader : public Endpoint {
 public:
  /// Takes the oldest sample (of any key) that was not yet taken; false if there is none. `writer` identifies its
  /// writer among all that this reader has matched.
  virtual bool take(std::vector<std::uint8_t>& cdr, std::uint64_t& writer) noexcept = 0;
  [[nodiscard]] virtual int alive_writers() const noexcept { return alive_; }
  /// See `HeldSamples`.
  virtual void trust(std::uint64_t) noexcept {}
  virtual void distrust() noexcept {}
  [[nodiscard]] virtual std::uint64_t refused() const noexcept { return 0; }
  /// The participant of a matched writer, the same for all of its topics; 0: not known.
  [[nodiscard]] virtual std::uint64_t participant_of(std::uint64_t) const noexcept { return 0; }
  /// The program of a writer that matches or has matched; none: not known.
  [[nodiscard]] virtual std::optional<PeerProgram> program_of(std::uint64_t) const { return {}; }
  /// The writers whose samples were refused: the first few.
  [[nodiscard]] virtual std::vector<std::uint64_t> foreign_writers() const { return {}; }

 protected:
  BackendReader(const char* topic, EventSink& events) : Endpoint("reader", topic, events) {}
  void change_liveliness(const auto& status) noexcept {
    alive_ = static_cast<int>(status.alive_count);
    report(Event::liveliness_lost, status.not_alive_count_change, "");
    events_.wake();
  }
  void lose(const auto& status) noexcept { report(Event::lost, status.total_count_change, ""); }
  void reject(const auto& status) noexcept { report(Event::rejected, status.total_count_change, "limits"); }

 private:
  std::atomic<int> alive_ = 0;
};

/// A reader whose samples the vendor's threads hold ready.
class HoldingReader : public BackendReader {
 public:
  bool take(std::vector<std::uint8_t>& cdr, std::uint64_t& writer) noexcept override { return held_.take(cdr, writer); }
  void trust(std::uint64_t writer) noexcept override { held_.trust(writer); }
  void distrust() noexcept override { held_.distrust(); }
  [[nodiscard]] std::uint64_t refused() const noexcept override { return held_.refused(); }
  [[nodiscard]] std::vector<std::uint64_t> foreign_writers() const override { return held_.foreign_writers(); }

 protected:
  HoldingReader(const EndpointSpec& spec, EventSink& events)
      : BackendReader(spec.topic.name, events), topic_(spec.topic), held_(spec.topic, spec.qos, spec.transit) {}

  /// Takes all that has arrived: `take_one(bytes, writer)` is false if there is no more. Any thread may call it at any
  /// time: one drains, and does it again if others called meanwhile.
  template <class TakeOne>
  void drain(TakeOne take_one) noexcept {
    if (calls_.fetch_add(1) > 0) return;
    for (int calls = 1;;) {
      try {
        while (take_one(scratch_, writer_)) {
          if (!is_known_key(topic_, scratch_)) {
            report(Event::rejected, 1, kUnknownKey);
          } else if (!held_.put(writer_, scratch_, HeldSamples::Clock::now())) {
            report(Event::refused, 1, "");
          }
        }
      } catch (const std::exception&) {
        report(Event::lost, 1, "");  // memory ran out
      }
      if (calls_.compare_exchange_strong(calls, 0)) break;
    }
    events_.wake();
  }
  void bury(std::uint64_t writer) noexcept { held_.bury(writer); }

 private:
  const TopicSpec topic_;
  HeldSamples held_;
  std::atomic<int> calls_ = 0;
  std::vector<std::uint8_t> scratch_;
  std::uint64_t writer_ = 0;
};

/// The properties with which a participant describes its program.
struct PeerProperties {
  const char* dds;  ///< the vendor that sends these
  const char* process;
  const char* host;
};
inline constexpr std::array kPeerProperties{
    PeerProperties{"fastdds", "fastdds.physical_data.process", "fastdds.physical_data.host"},
    PeerProperties{"cyclonedds", "__Pid", "__Hostname"}};

/// `property(name)` is the value of a participant's property, or empty.
PeerProgram describe_peer(std::string name, const auto& property) {
  PeerProgram program{std::move(name), {}, {}, {}};
  for (const PeerProperties& names : kPeerProperties) {
    const std::string process = property(names.process), host = property(names.host);
    if (process.empty() && host.empty()) continue;
    program.process = process;
    program.host = host.substr(0, host.find(':'));
    program.dds = names.dds;
  }
  return program;
}

/// Endpoints must be destroyed before their back end.
class Backend {
 public:
  virtual ~Backend() = default;
  virtual std::unique_ptr<BackendWriter> create_writer(const EndpointSpec& spec) = 0;
  virtual std::unique_ptr<BackendReader> create_reader(const EndpointSpec& spec) = 0;
  /// Interface and peers in effect, for `effective_settings`.
  [[nodiscard]] const std::string& route() const noexcept { return route_; }

 protected:
  std::string route_;
};

/// Longest datagram. On a network a datagram fits one packet: of a longer one the network loses the whole where it
/// loses any of its packets. Larger samples are sent in fragments, and lost fragments again.
inline constexpr int kMessageBytes = 65500;
inline constexpr int kPacketHeaderBytes = 28;  ///< IP and UDP

inline constexpr const char* kKeysCure = "the keys do not fit: examine them with `subworld keys check`; or ";

/// Files of DDS Security: what a program shows to prove its role, and by what it judges others.
struct Keys {
  std::string authority;    ///< certificate of the authority that signed all others
  std::string governance;   ///< signed: what is protected
  std::string certificate;  ///< of the role
  std::string private_key;
  std::string permissions;  ///< signed: what the role may publish
};

/// Parameters for opening a back end; addresses are dotted quads. Precedence: the user's flag, then the vendor's
/// environment variable or settings file, then the built-in default.
struct Opening {
  int domain = 0;
  int participants = 0;  ///< of the domain on a host, at most
  double thinning = 1.0;
  std::string participant_name;
  int message_bytes = kMessageBytes;
  std::string interface_address;   ///< flag; empty: as in the settings, else the default
  std::vector<std::string> peers;  ///< flag; empty: as in the settings, else the interface itself
  std::string settings_file;       ///< empty: none
  bool settings_from_environment = false;
  std::string settings_source;  ///< for `effective_settings`
  std::optional<Keys> keys;
};

inline constexpr const char* kDefaultInterface = "127.0.0.1";

/// The interface and the peers that a back end sets.
struct Route {
  std::string address;                            ///< empty: the settings have one
  std::optional<std::vector<std::string>> peers;  ///< none: the settings have them

  Route(const Opening& opening, bool settings_have_interface, bool settings_have_peers) {
    if (!opening.interface_address.empty() || !settings_have_interface)
      address = opening.interface_address.empty() ? kDefaultInterface : opening.interface_address;
    if (opening.peers.empty() && settings_have_peers) return;
    peers = opening.peers;
    if (!address.empty()) peers->push_back(address);  // the other programs of this host
  }
  [[nodiscard]] std::string text() const {
    return fmt::format("interface={} peers={}", address.empty() ? "(settings)" : address,
                       peers ? joined(*peers, ",") : "(settings)");
  }
};

/// Each plug-in exports this function. Throws `Error` (middleware).
using OpenBackend = Backend* (*)(const Opening&, EventSink&);
inline constexpr const char* kOpenBackendName = "subworld_open_backend";
/// And this one, for `--version`: the vendor's version.
using BackendVersion = const char* (*)();
inline constexpr const char* kBackendVersionName = "subworld_backend_version";

}  // namespace subworld::wire
