#pragma once

#include "model/error.hpp"
#include "model/network.hpp"
#include "wire/topics.hpp"

#include <cstdint>
#include <memory>
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
  std::string qos_file;            ///< vendor's settings; empty: its environment variable, else qos/ beside the program
  double device_period_s = 0.001;  ///< for deadlines
  double cycle_s = 0.004;          ///< the longest, for deadlines
  std::string participant_name = "subworld";
};

enum class Take : std::uint8_t {
  none,      ///< nothing new
  sample,    ///< the sample was replaced by the oldest one not yet taken
  rejected,  ///< a sample was dropped that did not decode or held nonsense
};

/// Sends one topic. Must not outlive its bus. One thread at a time.
template <class M>
class Writer {
 public:
  Writer(Writer&&) noexcept;
  Writer& operator=(Writer&&) noexcept;
  ~Writer();

  /// Sends in the caller's thread. False: not sent, the middleware or the memory refused it. In real time it does not
  /// wait; in lock-step it may wait up to 10 s for readers that lag behind.
  bool write(const M& sample) noexcept;
  /// Readers at this moment.
  [[nodiscard]] int matched() const noexcept;
  /// True once every reliable reader has all that was written, at latest after the timeout.
  bool wait_for_acknowledgments(double timeout_s) noexcept;
  [[nodiscard]] std::uint64_t sent_bytes() const noexcept;  ///< payload

 private:
  friend class Bus;
  struct Impl;
  explicit Writer(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

/// Receives one topic. Must not outlive its bus. One thread at a time.
template <class M>
class Reader {
 public:
  Reader(Reader&&) noexcept;
  Reader& operator=(Reader&&) noexcept;
  ~Reader();

  /// Receives the oldest sample not yet taken; samples of one key keep their order. Does not wait. False: none.
  bool receive() noexcept;
  /// What was received. False, and `sample` untouched, where it did not decode or held nonsense.
  bool decode(M& sample) noexcept;
  /// Both.
  Take take(M& sample) noexcept;
  /// From now on only the writer of what was received last is heard, whatever others claim to be: the middleware tells
  /// writers apart. What others send is dropped, and counted among the events. Only the first call counts.
  void trust_sender() noexcept;
  /// Samples that others than the trusted writer have sent.
  [[nodiscard]] std::uint64_t refused() const noexcept;
  /// Writers at this moment, dead or alive.
  [[nodiscard]] int matched() const noexcept;
  /// Writers that were heard of within the lease (100 ms).
  [[nodiscard]] int alive_writers() const noexcept;
  [[nodiscard]] std::uint64_t received_bytes() const noexcept;  ///< payload

 private:
  friend class Bus;
  struct Impl;
  explicit Reader(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

/// Two kinds of what the middleware reports: what should never happen, and silence or loss, which is normal where
/// programs come and go. That they do is counted, and needs no words.
enum class EventKind : std::uint8_t { fault, suppression };

/// One participant in a DDS domain. Loads the vendor's plug-in, so that a process needs only the vendor that it uses.
class Bus {
 public:
  /// Throws `Error` (middleware) that says where, what and the cure.
  explicit Bus(const BusConfig& config);
  ~Bus();
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  /// A partition separates users: only equal ones match; a reader may ask for "*". Throw `Error` (middleware).
  template <class M>
  [[nodiscard]] Writer<M> writer(const std::string& partition = {});
  template <class M>
  [[nodiscard]] Reader<M> reader(const std::string& partition = {});

  /// Waits for new data in any reader or any event since the last wait returned; false if there was none in time.
  /// One thread.
  bool wait(double timeout_s) noexcept;

  [[nodiscard]] EventCounts events() const noexcept;
  /// Events of that kind since the last call in words a user understands; each is said once for a topic, and then only
  /// counted. Empty if there is nothing to say.
  [[nodiscard]] std::string take_event_text(EventKind kind);
  /// Suppression up to now needs no words.
  void forget_silence() noexcept;
  /// What is in force, on one line.
  [[nodiscard]] const std::string& effective_settings() const noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Throws `Error` (middleware) that says where, what and the cure.
[[nodiscard]] std::unique_ptr<Bus> open_bus(const BusConfig& config);
/// A program's bus, as its command line and scene say.
[[nodiscard]] std::unique_ptr<Bus> open_bus(const Network& network, const Settings& settings, double device_period_s,
                                            const std::string& participant_name);

}  // namespace subworld
