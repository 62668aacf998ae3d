#pragma once

#include "model/messages/exchange.hpp"
#include "model/settings/agreed_settings.hpp"
#include "wire/bus.hpp"
#include "wire/status.hpp"

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// A random number that identifies a process, also among restarts of the same program. Never 0.
[[nodiscard]] std::uint64_t draw_identity();

/// In lock-step: a haptic process asks to take part. No other report confirms a frame that is ahead of it.
[[nodiscard]] inline bool asks_to_take_part(const HapticReport& report) noexcept {
  return report.confirmed_stamp > report.stamp;
}

/// For example "haptic_sim 0" or "world_sim".
[[nodiscard]] std::string label_of(ProgramKind program, std::uint32_t instance);

/// Error text for a peer that belongs to another run, or was restarted.
[[nodiscard]] std::string replaced_text(ProgramKind program, std::uint32_t instance);

/// Error text where a peer serves another process in the place of this one.
[[nodiscard]] std::string displaced_text(ProgramKind peer, std::uint32_t instance);

/// Finds the session of the world in whose run a program takes part, from topic `scene`. Only the description of a
/// program counts that sends a status as world_sim: a foreign writer of the topic cannot prevent a start.
class SessionFinder {
 public:
  /// `scene`: of the program's scene file and flags; it must outlive this object.
  SessionFinder(Reader<SceneDescription>& reader, const Scene& scene, const StatusBeacon& status)
      : reader_(&reader), scene_(scene), status_(&status), settings_(agreed_settings(scene)) {}

  /// Takes all available samples; true once a world with the same settings is known. The newest one counts. Throws
  /// `Error` (usage) if a world has other settings or another version, once it can no longer be an earlier run that is
  /// ending.
  bool look(int domain);
  [[nodiscard]] std::uint64_t session() const noexcept { return session_; }

 private:
  void accept(std::uint64_t session, std::string misfit);
  /// What of the world's description does not fit, with the cure; empty: it fits.
  [[nodiscard]] std::string misfit(int domain) const;

  Reader<SceneDescription>* reader_;
  const Scene& scene_;
  const StatusBeacon* status_;
  std::vector<NamedSetting> settings_;
  std::uint64_t session_ = 0;
  SceneDescription description_;
  /// Newest description of each participant that has sent no status so far, in the order of their arrival.
  struct Unknown {
    std::uint64_t participant = 0;
    std::uint64_t session = 0;
    std::string misfit;
  };
  std::vector<Unknown> unknown_;
  std::string misfit_;                                          ///< of the newest description
  std::optional<std::chrono::steady_clock::time_point> other_;  ///< when a world with other settings was first seen
};

}  // namespace subworld
