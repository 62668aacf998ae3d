#pragma once

#include "io/options.hpp"
#include "model/exchange.hpp"
#include "picture.hpp"
#include "wire/bus.hpp"
#include "wire/status.hpp"

#include <memory>
#include <string>
#include <vector>

namespace subworld {

/// All topics of the display process.
struct DisplayPorts {
  DisplayPorts(const Options& options, const Scene& scene);

  std::unique_ptr<Bus> bus;
  Reader<SceneDescription> scene;
  Reader<WorldSnapshot> snapshots;
  Reader<Status> statuses;
  StatusBeacon status;
};

/// The world as last received.
class Display {
 public:
  void describe(SceneDescription&& description);
  void show(const WorldSnapshot& snapshot);
  /// Writes a picture. Throws `Error` (failed).
  void write_picture(const std::string& file);

  [[nodiscard]] bool described() const noexcept { return !scene_.bodies.empty(); }
  [[nodiscard]] double time_s() const noexcept { return time_s_; }
  [[nodiscard]] std::uint64_t snapshots() const noexcept { return snapshots_; }

 private:
  SceneDescription scene_;
  std::vector<UserView> users_;
  std::unique_ptr<Renderer> renderer_;
  double time_s_ = 0.0;
  std::uint64_t snapshots_ = 0;
};

}  // namespace subworld
