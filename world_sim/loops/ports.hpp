#pragma once

#include "io/options/options.hpp"
#include "io/results/program_results.hpp"
#include "physics/engine.hpp"
#include "wire/bus.hpp"
#include "wire/session.hpp"
#include "wire/status.hpp"

#include <memory>
#include <set>
#include <string>
#include <vector>

namespace subworld {

/// Everything that enters or leaves the world process.
struct WorldPorts {
  WorldPorts(const Options& options, const Scene& scene);

  /// Publishes all that a late joiner needs to create every body. `engine` has their states.
  void describe(const Scene& scene_file, const Engine& engine);
  /// Whether a report is of this run, and of the process that is served, if one is.
  [[nodiscard]] bool belongs(std::size_t user, const HapticReport& report) const noexcept {
    return report.session == session && (served[user] == 0 || report.sender == served[user]);
  }
  /// From now on serves the process that has sent the report received last, unless one is served.
  void serve(std::size_t user, std::uint64_t sender) noexcept;
  /// From now on serves none: the next one that joins.
  void release(std::size_t user) noexcept;

  /// What to do about another world_sim that has shown up on this domain since the last call; empty: none has. A
  /// foreign writer of the topic, which sends no status as world_sim, is only counted.
  [[nodiscard]] std::string second_world();
  /// How many have shown up.
  [[nodiscard]] std::uint64_t other_worlds() const noexcept { return other_worlds_; }
  /// Samples of others than the programs that take part, by topic.
  [[nodiscard]] WorldRefused refused() const;

  const std::uint64_t session = draw_identity();
  const int domain;
  std::vector<std::uint64_t> served;  ///< the haptic process, by user; 0: none
  std::unique_ptr<Bus> bus;
  Writer<SceneDescription> scene;
  Reader<SceneDescription> worlds;            ///< who else describes one
  std::vector<Writer<WorldFrame>> frames;     ///< by user
  std::vector<Reader<HapticReport>> reports;  ///< by user
  Writer<WorldSnapshot> snapshots;
  Reader<Control> control;
  StatusBeacon status;

 private:
  /// A description of another world, from a participant that has sent no status so far.
  struct UnknownScene {
    std::uint64_t participant = 0;
    std::string name;
  };
  std::vector<UnknownScene> unknown_scenes_;
  std::set<std::string> scene_writers_;  ///< programs that have described another world
  SceneDescription heard_scene_;
  std::uint64_t other_worlds_ = 0;
  std::uint64_t second_worlds_ = 0;  ///< descriptions of other worlds that have come
};

}  // namespace subworld
