#pragma once

#include "model/scene/scene.hpp"
#include "run/placement.hpp"
#include "run/run.hpp"
#include "session/host.hpp"
#include "session/session_file.hpp"

#include <functional>
#include <string>
#include <vector>

namespace subworld {

/// What starts where in a run.
struct RunPlan {
  RunRequest request;  ///< with the options of the session
  Session session;
  Placement placement;

  /// Whether ssh starts the programs of a host.
  [[nodiscard]] bool is_distant(const SessionHost& host) const;
  /// Whether all programs of the run start on this machine.
  [[nodiscard]] bool all_here() const;
  /// False for the programs of a user of --without: they are started later by hand, or with --host.
  [[nodiscard]] bool starts(const RunProgram& program) const;
  /// Calls `start` for each program of the run with its vendor. The world is the first: it ends the others in order.
  void each_program(const std::function<void(const RunProgram&, const std::string& vendor)>& start) const;
  /// Files of the results, once they are in one folder.
  [[nodiscard]] std::vector<std::string> parts() const;
  /// The arguments of a program on a host.
  [[nodiscard]] std::vector<std::string> flags_of(const Host& host, const RunProgram& program,
                                                  const std::string& vendor) const;
  /// The program that shows the run to ROS 2, from this host.
  [[nodiscard]] Command ros2() const;
  /// With which the launcher listens to the run on one of its hosts.
  [[nodiscard]] Network network_of(const SessionHost& host) const;

 private:
  [[nodiscard]] std::vector<std::string> peers_of(const SessionHost& host) const;
};

/// Reads session and scene, and checks them with the request. Throws `Error` (usage, middleware).
[[nodiscard]] RunPlan plan_run(const RunRequest& request, Scene& scene);

/// File of a program's part of the trace, until the parts are merged.
[[nodiscard]] std::string trace_part(const std::string& folder, const RunProgram& program);

}  // namespace subworld
