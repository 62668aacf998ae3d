#pragma once

#include "wire/topics.hpp"

#include <cstdint>
#include <iterator>
#include <memory>
#include <span>
#include <string>
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
  std::string partition;  ///< empty: the default one
};

class BackendWriter {
 public:
  virtual ~BackendWriter() = default;
  /// False if the sample was not accepted.
  virtual bool write(std::span<const std::uint8_t> cdr) noexcept = 0;
  [[nodiscard]] virtual int matched() const noexcept = 0;
  virtual bool wait_for_acknowledgments(double timeout_s) noexcept = 0;
};

class BackendReader {
 public:
  virtual ~BackendReader() = default;
  /// Takes the oldest sample (of any key) that was not yet taken; false if there is none. `writer` identifies its
  /// writer among all that this reader has matched.
  virtual bool take(std::vector<std::uint8_t>& cdr, std::uint64_t& writer) noexcept = 0;
  [[nodiscard]] virtual int matched() const noexcept = 0;
  [[nodiscard]] virtual int alive_writers() const noexcept = 0;
};

/// Endpoints must be destroyed before their back end.
class Backend {
 public:
  virtual ~Backend() = default;
  virtual std::unique_ptr<BackendWriter> create_writer(const EndpointSpec& spec) = 0;
  virtual std::unique_ptr<BackendReader> create_reader(const EndpointSpec& spec) = 0;
  /// Version, interface and peers in effect, for `effective_settings`.
  [[nodiscard]] virtual std::string describe() const = 0;
};

/// Largest number of participants of one domain on one host.
inline constexpr int kMostParticipants = 32;
/// Size of one datagram; larger samples are sent in fragments.
inline constexpr int kMessageBytes = 65500;

/// Parameters for opening a back end; addresses are dotted quads. Precedence: the user's flag, then the vendor's
/// environment variable or settings file, then the built-in default.
struct Opening {
  int domain = 0;
  std::string participant_name;
  std::string interface_address;   ///< flag; empty: as in the settings, else the default
  std::vector<std::string> peers;  ///< flag; empty: as in the settings, else the interface itself
  std::string settings_file;       ///< empty: none
  bool settings_from_environment = false;
};

inline constexpr const char* kDefaultInterface = "127.0.0.1";

inline constexpr std::uint32_t kPartitionPolicy = 10;
/// Policy ids of the DDS specification, used by both vendors.
constexpr const char* policy_name(std::uint32_t id) noexcept {
  constexpr const char* kNames[] = {"unknown policy",   "USERDATA",        "DURABILITY",     "PRESENTATION",
                                    "DEADLINE",         "LATENCYBUDGET",   "OWNERSHIP",      "OWNERSHIPSTRENGTH",
                                    "LIVELINESS",       "TIMEBASEDFILTER", "PARTITION",      "RELIABILITY",
                                    "DESTINATIONORDER", "HISTORY",         "RESOURCELIMITS", "ENTITYFACTORY"};
  return id < std::size(kNames) ? kNames[id] : kNames[0];
}

/// Each plug-in exports this function. Throws `Error` (middleware).
using OpenBackend = Backend* (*)(const Opening&, EventSink&);
inline constexpr const char* kOpenBackendName = "subworld_open_backend";
/// And this one, for `--version`: the vendor's version.
using BackendVersion = const char* (*)();
inline constexpr const char* kBackendVersionName = "subworld_backend_version";

}  // namespace subworld::wire
