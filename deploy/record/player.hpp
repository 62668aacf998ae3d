#pragma once

#include "io/records/mcap_reader.hpp"
#include "model/messages/exchange.hpp"
#include "rt/cyclic.hpp"
#include "wire/bus.hpp"
#include "wire/codec/codec.hpp"
#include "wire/observer.hpp"

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace subworld {

/// Publishes a recording in the place of the programs that were recorded. Its time is the simulated time of the world's
/// snapshots; other messages follow the snapshot before them. Orders on the topic `control` pause, resume,
/// step (to the next snapshot), move (`reset`, with the moment in seconds), change its speed and stop it. Recorded
/// orders and their answers are not published. The scene's settings also have `replay.from_s` and `replay.to_s`, the
/// first and the last moment, so that a viewer knows a replay. The real-time factor in the world's status is the speed.
class Player {
 public:
  struct Config {
    double speed = 1.0;   ///< simulated time per time
    double from_s = 0.0;  ///< simulated time
    bool paused = false;
    bool stays = false;  ///< pauses at the end, and goes on until it is stopped
  };
  /// Throws `Error` (usage, middleware).
  Player(mcap::Reader& reader, Bus& bus, const Config& config);

  /// Publishes what is due, and executes orders. False at its end. Waits for at most `wait_s`.
  bool advance(double wait_s);
  [[nodiscard]] std::uint64_t published() const noexcept { return published_; }
  [[nodiscard]] double time_s() const noexcept { return published_s_; }

 private:
  struct Channel {
    std::size_t topic = 0;
    std::unique_ptr<wire::BackendWriter> writer;
  };
  struct Due {
    std::uint16_t channel = 0;
    double time_s = 0.0;  ///< of the last snapshot before it
    std::vector<std::uint8_t> data;
    bool snapshot = false;
  };
  void open_channels(Bus& bus);
  /// Publishes the recorded scene, with the first and the last moment. Throws `Error` (usage) where there is none.
  void publish_scene();
  /// The simulated time of the first or last snapshot in a chunk; none: it has no snapshot.
  [[nodiscard]] std::optional<double> time_of(const mcap::Chunk& chunk, bool last);
  /// Reads the next messages, where none is due. False at the end of the file.
  bool read_more();
  void publish(Due& due);
  void move_to(double time_s);
  void execute(const Control& order);
  void restart_clock();
  void learn(const Status& status);
  void learn(const WorldSnapshot& snapshot);
  /// All bodies as they are now.
  void publish_snapshot();
  void publish_statuses();

  mcap::Reader& reader_;
  Config config_;
  std::map<std::uint16_t, Channel> channels_;
  Reader<Control> orders_;
  Writer<ControlReply> answers_;
  Writer<WorldSnapshot> snapshots_;
  Writer<Status> statuses_;
  Codec<WorldSnapshot> snapshot_codec_;
  Codec<Status> status_codec_;
  SceneDescription scene_;
  WorldSnapshot snapshot_;  ///< the newest one, for its users
  std::vector<BodyState> states_;
  std::map<std::pair<ProgramKind, std::uint32_t>, Status> newest_statuses_;
  TimePoint statuses_at_;
  std::size_t next_chunk_ = 0;
  std::deque<Due> due_;
  double read_s_ = 0.0;  ///< simulated time of the last snapshot that was read
  double published_s_ = 0.0;
  std::uint64_t published_ = 0;
  bool paused_ = false;
  bool stopped_ = false;
  TimePoint clock_from_;
  double clock_from_s_ = 0.0;
};

}  // namespace subworld
