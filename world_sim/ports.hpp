#pragma once

#include "io/options.hpp"
#include "io/program_results.hpp"
#include "physics/engine.hpp"
#include "wire/bus.hpp"
#include "wire/session.hpp"
#include "wire/status.hpp"

#include <memory>
#include <vector>

namespace subworld {

/// Everything that enters or leaves the world process.
struct WorldPorts {
  WorldPorts(const Options& options, const Scene& scene);

  /// Publishes all that a late joiner needs to create every body. `engine` has their states.
  void describe(const Scene& scene_file, const Engine& engine);
  /// Whether a report is of this run and of the process that is served; the first one of a user is, from then on.
  bool accept(std::size_t user, const HapticReport& report) noexcept;

  /// What to do about another world that has shown up on this domain since the last call; empty: none has.
  [[nodiscard]] std::string second_world();
  /// Samples of others than the programs that take part, by topic.
  [[nodiscard]] WorldRefused refused() const;

  const std::uint64_t session = draw_identity();
  const int domain;
  std::vector<std::uint64_t> served;  ///< the haptic process, by user; 0: none was heard of yet
  std::unique_ptr<Bus> bus;
  Writer<SceneDescription> scene;
  Reader<SceneDescription> worlds;            ///< who else describes one
  std::vector<Writer<WorldFrame>> frames;     ///< by user
  std::vector<Reader<HapticReport>> reports;  ///< by user
  Writer<WorldSnapshot> snapshots;
  Reader<Control> control;
  StatusBeacon status;

 private:
  SceneDescription heard_scene_;
  std::uint64_t second_worlds_ = 0;  ///< descriptions of other worlds that have come
};

}  // namespace subworld
