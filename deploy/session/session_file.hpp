#pragma once

#include "model/scene.hpp"
#include "run/launch.hpp"

#include <string>
#include <string_view>
#include <vector>

namespace subworld {

/// A program of a session: the world, the display, or a user's haptic or device process.
struct SessionProgram {
  std::string name;  ///< world_sim, haptic_sim, device_sim or gui_headless
  int user = -1;     ///< of haptic_sim and device_sim

  /// "haptic_sim_0", "world_sim".
  [[nodiscard]] std::string label() const;
  bool operator==(const SessionProgram&) const = default;
};

struct SessionHost {
  std::string name;
  std::string address;            ///< IPv4 address or name, for the other hosts; empty where the launcher gives one
  std::string network_interface;  ///< own interface, by name or address; likewise
  std::string ssh;                ///< destination for ssh; empty: programs start on the machine of `subworld up`
  std::string folder;             ///< checkout of Subworld on that host; empty: the login folder's `subworld`
  std::string dds;                ///< vendor of its programs; empty: the session's
  std::vector<SessionProgram> programs;
};

/// The programs of one run on several hosts.
struct Session {
  std::string file;
  std::string name;
  std::string dds = "fastdds";
  int domain = 70;
  std::string link;  ///< between any two hosts, with --namespaces; see `subworld link`
  std::vector<SessionHost> hosts;
  Options options;  ///< of the run: scene and flags

  /// The vendor that all programs use, or "mixed".
  [[nodiscard]] std::string vendors() const;
  /// This vendor, or mixed, in place of those of the session and of its hosts.
  void use_vendor(const std::string& vendor);
  /// Throws `Error` (usage) with the known names.
  [[nodiscard]] const SessionHost& host(const std::string& name) const;
};

/// The file of a session that a command line gives by its path, or by its name in deploy/sessions. Throws `Error`
/// (usage).
[[nodiscard]] std::string session_file(const std::string& session);

/// Reads a session file. Throws `Error` (usage) with file:line:column, the key and the cure: also where a program that
/// the scene needs is missing, or runs twice.
[[nodiscard]] Session load_session(const std::string& file);

/// Throws `Error` (usage) where the session's programs are not the ones that the scene needs.
void check_programs(const Session& session, const Scene& scene);

}  // namespace subworld
