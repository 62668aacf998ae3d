#pragma once

#include "io/options/options.hpp"
#include "model/scene/scene.hpp"
#include "run/run.hpp"

#include <string>
#include <vector>

namespace subworld {

/// A program of a run: the world, the display, or a user's haptic or device process.
struct RunProgram {
  std::string name;  ///< world_sim, haptic_sim, device_sim or gui_headless
  int user = -1;     ///< of haptic_sim and device_sim

  /// "haptic_sim_0", "world_sim".
  [[nodiscard]] std::string label() const;
  bool operator==(const RunProgram&) const = default;
};

struct SessionHost {
  std::string name;
  std::string address;            ///< IPv4 address or name, for the other hosts; empty where the launcher gives one
  std::string network_interface;  ///< own interface, by name or address; likewise
  std::string ssh;                ///< destination for ssh; empty: programs start on the machine of `subworld up`
  std::string folder;  ///< checkout or installation there; empty: the login folder's `subworld`, else the system's
  std::string dds;     ///< vendor of its programs; empty: the session's
  std::vector<RunProgram> programs;

  [[nodiscard]] bool runs(const RunProgram& program) const;
};

/// The hosts of one run and their programs.
struct Session {
  std::string file;  ///< empty: of `subworld run`, with one host
  std::string name;
  std::string dds = "fastdds";
  int domain = 70;
  std::string link;  ///< between any two hosts, with --namespaces; see `subworld link`
  std::vector<SessionHost> hosts;
  Options options;  ///< of the run: scene and flags

  /// The vendor that all programs use, or "mixed".
  [[nodiscard]] std::string vendors() const;
  [[nodiscard]] bool runs(const RunProgram& program) const;
  /// A run on one machine has none.
  [[nodiscard]] bool has_file() const noexcept { return !file.empty(); }
};

/// Reads the session file that the request names. Throws `Error` (usage) with file:line:column, the key and the cure:
/// also where the request does not fit it.
[[nodiscard]] Session load_session(const RunRequest& request);

/// The session of one host, this machine, without a name: its programs are all that the run has.
[[nodiscard]] Session session_of_this_machine(const RunRequest& request, const Scene& scene);

/// Throws `Error` (usage) where the session's programs are not the ones that the scene needs.
void check_programs(const Session& session, const Scene& scene);

}  // namespace subworld
