#pragma once

#include "io/results.hpp"
#include "lab/coupling/measure.hpp"

#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// What the programs are started with, beyond the settings of a `Point`.
struct OverLink {
  std::string link;             ///< as `subworld link` reads it: between any two hosts, each way
  std::string dds = "fastdds";  ///< vendor, or mixed
  int domain = 70;
};

/// One run of the real programs in real time, with the world and each user on a host of their own, between which a link
/// is emulated (`subworld up --namespaces`).
struct LinkedRun {
  Json summary;                      ///< of the run
  std::vector<FeltHistory> felt;     ///< by user; force and on_operator only, on the reference's haptic steps
  std::vector<double> path_delay_s;  ///< by user: when the device started its path
  Outcome reference;                 ///< of the scene whose devices start then
};

/// In real time a device starts its path when its haptic process first answers, at another instant for each user. That
/// instant is found from the positions of the device, and a reference is run whose devices start then. What is left of
/// a lag between the forces is that of the force behind the motion.
///
/// The scene is the point's file: variants, boxes, budgets, delays, stiffness factors and later starts of a point have
/// no flags and are not used. `punctual`: the point's reference, whose devices start at t = 0. Empty if a signal
/// requested a stop. Throws `Error` (failed) with the launcher's message where the run failed.
[[nodiscard]] std::optional<LinkedRun> run_over_link(const Point& point, const OverLink& over, const Outcome& punctual);

/// Positions of a device by time.
struct DevicePath {
  std::vector<double> time_s;  ///< ascending
  std::vector<Vec3> position;  ///< m
};
/// The delay of a path behind a reference on a grid of step h (s), within +- `most_s`, to 0.1 ms.
[[nodiscard]] double path_delay_s(const DevicePath& path, const std::vector<Vec3>& reference, double h_s,
                                  double most_s = 0.5);

}  // namespace subworld
