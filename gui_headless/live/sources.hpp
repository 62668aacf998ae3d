#pragma once

#include "model/messages/exchange.hpp"
#include "outbox.hpp"
#include "wire/codec/codec.hpp"
#include "wire/observer.hpp"
#include "wire/peer_program.hpp"
#include "world_view.hpp"

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace subworld::live {

/// A stream of messages of one type; a topic, of one user where users have their own.
struct Channel {
  std::uint32_t id = 0;
  std::string topic;
  std::string type;  ///< as the schema names it
  std::string schema;
  std::optional<std::size_t> row;  ///< of `kTopicTable`; none: made here
  std::string partition;
};

inline constexpr std::string_view kToolsTopic = "/tools", kVerdictTopic = "/verdict";

/// The channels, and the readers of those to which somebody subscribes. One thread.
class Sources {
 public:
  using Deliver = std::function<void(const Channel&, const Sample&)>;

  Sources(const Bus& bus, int users);

  [[nodiscard]] const std::vector<Channel>& channels() const noexcept { return channels_; }
  /// Null if there is none.
  [[nodiscard]] const Channel* channel(std::uint32_t id) const noexcept;

  /// Somebody subscribes to a channel: the first one opens its reader. Throws `Error` (middleware).
  void subscribe(const Channel& channel);
  /// One fewer; the last one closes the reader.
  void unsubscribe(const Channel& channel) noexcept;
  /// The newest sample of each key, for a client that joins.
  [[nodiscard]] std::vector<Sample> newest(const Channel& channel) const;

  /// The world as first received.
  void describe(std::shared_ptr<const SceneDescription> scene, const Deliver& deliver);
  /// Where a program of the run was found; also where it is known.
  void place(ProgramKind program, std::uint32_t instance, const PeerProgram& peer, const Deliver& deliver);
  /// The newest message, as CDR, of a key of a channel that is made elsewhere, as kToolsTopic and kVerdictTopic are;
  /// delivered where it differs from the last one.
  void show(std::string_view topic, std::vector<std::uint8_t> cdr, const Deliver& deliver, std::uint64_t key = 0);
  /// Whether somebody subscribes to the verdict.
  [[nodiscard]] bool verdict_is_awaited() const noexcept;
  /// Receives what has arrived and delivers the newest sample of each key.
  void poll(const Deliver& deliver);

 private:
  struct Open {
    int subscribers = 0;
    std::unique_ptr<wire::BackendReader> observer;  // none: another reader has it, or it comes from no topic
    std::map<std::uint64_t, Sample> newest;
  };
  void poll_topic(const Channel& channel, Open& open, const Deliver& deliver);
  void poll_made(const Channel& channel, Open& open, const Deliver& deliver);
  void take_states(std::span<const std::uint8_t> cdr);
  void take_forces();
  [[nodiscard]] std::optional<std::vector<std::uint8_t>> make_scene_update(std::uint64_t now_ns);

  const Bus& bus_;
  std::vector<Channel> channels_;
  std::map<std::uint32_t, Open> open_;
  std::shared_ptr<const SceneDescription> scene_;
  std::map<std::string, std::map<std::uint64_t, Sample>> shown_;  // by topic and key
  std::uint64_t events_ = 0;
  WorldViewer viewer_;
  // of the scene update
  Codec<WorldSnapshot> codec_;
  WorldSnapshot snapshot_;
  std::vector<BodyState> states_;
  std::vector<std::unique_ptr<wire::BackendReader>> commands_;  // to each device, while updates are wanted
  std::vector<Vec3> forces_n_;                                  // on each operator
  bool changed_ = false;
  std::uint64_t next_update_ns_ = 0;
};

/// The message of kVerdictTopic. Throws `std::exception` where the summary has no verdict.
[[nodiscard]] std::vector<std::uint8_t> encode_verdict(const std::string& summary_file);

/// Time since 1970, ns.
[[nodiscard]] std::uint64_t wall_time_ns() noexcept;

}  // namespace subworld::live
