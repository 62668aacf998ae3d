#pragma once

#include "io/mcap_reader.hpp"
#include "model/exchange.hpp"
#include "wire/codec.hpp"

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// The world of a recording at any moment of its simulated time.
class RecordedWorld {
 public:
  /// Throws `Error` (usage), as all functions here do, where the file is no finished recording.
  explicit RecordedWorld(const std::string& file);

  [[nodiscard]] const SceneDescription& scene() const noexcept { return scene_; }
  [[nodiscard]] double from_s() const noexcept { return from_s_; }
  [[nodiscard]] double to_s() const noexcept { return to_s_; }

  /// The moment that `states` and `users` show from now on; between two snapshots the states are interpolated. Moments
  /// outside the recording are its first or last one. Forward steps read each chunk once.
  void show(double time_s);
  [[nodiscard]] const std::vector<BodyState>& states() const noexcept { return shown_; }
  [[nodiscard]] const std::vector<UserView>& users() const noexcept { return before_.users; }

 private:
  struct Moment {
    double time_s = 0.0;
    std::vector<BodyState> states;
    std::vector<UserView> users;
  };
  void restart(double time_s);
  bool read_next();
  std::optional<double> first_stamp(const mcap::Chunk& chunk);

  mcap::Reader reader_;
  SceneDescription scene_;
  Codec<WorldSnapshot> codec_;
  std::uint16_t channel_ = 0;
  double from_s_ = 0.0, to_s_ = 0.0;
  std::size_t next_chunk_ = 0;
  std::deque<WorldSnapshot> read_;
  Moment before_, after_;
  std::vector<BodyState> shown_;
};

}  // namespace subworld
