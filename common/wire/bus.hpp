#pragma once

#include "model/error.hpp"
#include "model/settings/network.hpp"
#include "wire/peer_program.hpp"
#include "wire/topics.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace subworld {

enum class Vendor : std::uint8_t { fastdds, cyclonedds };

/// "fastdds" or "cyclonedds". Throws `Error` (usage) for anything else.
[[nodiscard]] Vendor parse_vendor(std::string_view name);
[[nodiscard]] const char* name_of(Vendor vendor) noexcept;

struct BusConfig {
  Vendor vendor = Vendor::fastdds;
  int domain = 0;  ///< 0 .. 232
  Mode mode = Mode::lockstep;
  std::vector<std::string> peers;  ///< hosts of the other programs; empty: this host, or as the settings say
  std::string interface_address;   ///< empty: as the settings say, else 127.0.0.1
  std::string qos_file;            ///< vendor's settings; empty: its variable, /etc/subworld, else qos/ beside programs
  std::string secure;              ///< folder of keys; empty: no security
  double device_period_s = 0.001;  ///< for deadlines
  double cycle_s = 0.004;          ///< the longest cycle, for deadlines
  DelaySettings delay;             ///< of the samples of its readers, in real time
  int users = 0;                   ///< of the run; 0: not known
  int participants = 32;           ///< of the domain on a host, at most: each host is searched for so many
  std::string participant_name = "subworld";
};

enum class Take : std::uint8_t {
  none,      ///< no new sample
  sample,    ///< the sample was replaced by the oldest one not yet taken
  rejected,  ///< a sample was dropped that did not decode or had invalid contents
};

class Bus;

/// The part of a writer that is the same for all topics.
class AnyWriter {
 public:
  AnyWriter(AnyWriter&&) noexcept;
  AnyWriter& operator=(AnyWriter&&) noexcept;
  ~AnyWriter();

  /// Number of matched readers.
  [[nodiscard]] int matched() const noexcept;
  /// Waits until every reliable reader has received all samples, or until the timeout. Returns whether they have.
  bool wait_for_acknowledgments(double timeout_s) noexcept;
  [[nodiscard]] std::uint64_t sent_bytes() const noexcept;  ///< payload

 protected:
  AnyWriter(const Bus& bus, std::size_t topic, const std::string& partition, std::optional<double> shared_period_s,
            std::optional<Mode> quality);
  bool write_any(const void* sample) noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Writes one topic. Must not outlive its bus. One thread at a time.
template <class M>
class Writer : public AnyWriter {
 public:
  /// Sends in the caller's thread. Returns false if the middleware refused the sample or memory ran out. In real time
  /// it does not block; in lock-step it may wait up to 10 s for slow readers.
  bool write(const M& sample) noexcept { return write_any(&sample); }

 private:
  friend class Bus;
  Writer(const Bus& bus, const std::string& partition, std::optional<double> shared_period_s = {},
         std::optional<Mode> quality = {})
      : AnyWriter(bus, kTopicIndex<M>, partition, shared_period_s, quality) {}
};

/// The part of a reader that is the same for all topics.
class AnyReader {
 public:
  AnyReader(AnyReader&&) noexcept;
  AnyReader& operator=(AnyReader&&) noexcept;
  ~AnyReader();

  /// Receives the oldest sample not yet taken; samples of one key stay in order. Does not block. False if there is
  /// none.
  bool receive() noexcept;
  /// From now on accepts only the writer of the sample received last. The middleware identifies writers, so the
  /// contents of a sample cannot forge one. Samples of foreign writers are dropped and counted as events. Further calls
  /// have an effect once that writer is dead, or silent for 2 s while another one writes: then others are accepted.
  void trust_sender() noexcept;
  /// From now on accepts every writer, until trust_sender().
  void distrust() noexcept;
  /// Identifies the program that wrote the sample received last, the same in all topics; 0: not known.
  [[nodiscard]] std::uint64_t sender_participant() const noexcept;
  /// Number of samples of foreign writers.
  [[nodiscard]] std::uint64_t refused() const noexcept;
  /// The programs of foreign writers, the first few: "world_sim, process 123 on host"; empty: not known.
  [[nodiscard]] std::string foreign_programs() const;
  /// The program that wrote the sample received last; none: not known.
  [[nodiscard]] std::optional<PeerProgram> sender_program() const;
  /// Number of matched writers, dead or alive.
  [[nodiscard]] int matched() const noexcept;
  /// Writers with a sign of life within the lease (100 ms; 1 s in lock-step). Fast DDS 2.9 counts a killed one as long
  /// as any other program is alive, or until a program takes over its UDP port, as one that starts again does.
  [[nodiscard]] int alive_writers() const noexcept;
  [[nodiscard]] std::uint64_t received_bytes() const noexcept;  ///< payload

 protected:
  AnyReader(const Bus& bus, std::size_t topic, const std::string& partition, std::optional<double> shared_period_s);
  bool decode_any(void* sample) noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Reads one topic. Must not outlive its bus. One thread at a time.
template <class M>
class Reader : public AnyReader {
 public:
  /// Decodes the received sample. Returns false, and leaves `sample` unchanged, if it does not decode or has invalid
  /// contents.
  bool decode(M& sample) noexcept { return decode_any(&sample); }
  /// receive() and decode().
  Take take(M& sample) noexcept {
    if (!receive()) return Take::none;
    return decode(sample) ? Take::sample : Take::rejected;
  }

 private:
  friend class Bus;
  Reader(const Bus& bus, const std::string& partition, std::optional<double> shared_period_s = {})
      : AnyReader(bus, kTopicIndex<M>, partition, shared_period_s) {}
};

/// Kinds of middleware events. `fault`: must not happen. `absence`: a peer or a sample is missing, which is normal
/// while programs start and end. Matching is only counted, without a text.
enum class EventKind : std::uint8_t { fault, absence };

/// One participant in a DDS domain. Loads the vendor's plug-in, so that a process needs only the vendor that it uses.
class Bus {
 public:
  /// Throws `Error` (middleware) with place, fault and cure.
  explicit Bus(const BusConfig& config);
  ~Bus();
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  /// A partition separates users: only equal partitions match; a reader may ask for "*". All throw `Error`
  /// (middleware).
  template <class M>
  [[nodiscard]] Writer<M> writer(const std::string& partition = {}) {
    return {*this, partition};
  }
  /// From a bus of real time to readers of both modes: of lock-step quality.
  template <class M>
  [[nodiscard]] Writer<M> writer_to_all() {
    return {*this, {}, {}, Mode::lockstep};
  }
  template <class M>
  [[nodiscard]] Reader<M> reader(const std::string& partition = {}) {
    return {*this, partition};
  }
  /// Of kSharedDeviceState. `period_s`: of the samples, which the writer of all states has recorded already.
  [[nodiscard]] Writer<DeviceState> shared_device_writer(const std::string& partition, double period_s) {
    return {*this, partition, period_s};
  }
  [[nodiscard]] Reader<DeviceState> shared_device_reader(const std::string& partition, double period_s) {
    return {*this, partition, period_s};
  }

  /// Waits for new data in any reader, or for an event, since the last call returned. False after the timeout. One
  /// thread.
  bool wait(double timeout_s) noexcept;

  [[nodiscard]] EventCounts events() const noexcept;
  /// Text for the events of this kind since the last call. Each is reported once for a topic, and then only counted.
  /// Empty if there is none.
  [[nodiscard]] std::string take_event_text(EventKind kind);
  /// Discards the texts of absences up to now.
  void forget_absences() noexcept;
  /// Version, interface and peers in effect, on one line.
  [[nodiscard]] const std::string& effective_settings() const noexcept;

 private:
  friend class AnyWriter;
  friend class AnyReader;
  friend class Observer;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Each user's frames and reports, and each device's states and commands, have their own partition.
inline std::string user_partition(int user) { return "user_" + std::to_string(user); }
inline std::string device_partition(int device) { return "device_" + std::to_string(device); }
inline constexpr const char* kAllDevices = "device_*";
/// Longest regular time between two samples of kSharedDeviceState for a device of this rate, s.
[[nodiscard]] double shared_period_s(const Settings& settings, double rate_hz) noexcept;

/// Throws `Error` (middleware) with place, fault and cure.
[[nodiscard]] std::unique_ptr<Bus> open_bus(const BusConfig& config);
/// Throws `Error` (middleware) where `open_bus` would not find the keys of a program, by its participant's name.
void check_keys(const std::string& folder, const std::string& program);
/// Checks interface, peers and settings file as open_bus does, without opening anything. Throws like it.
void check_network(const Network& network);
/// Opens a program's bus by its command line and scene.
[[nodiscard]] std::unique_ptr<Bus> open_bus(const Network& network, const Settings& settings, double device_period_s,
                                            const std::string& participant_name);

}  // namespace subworld
