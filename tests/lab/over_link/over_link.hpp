#pragma once

#include "io/results/results.hpp"
#include "lab/coupling/measure.hpp"

#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// What the programs are started with, beyond the settings of a `Point`.
struct OverLink {
  std::string link;             ///< as `subworld link` reads it: between any two hosts, each way
  std::string dds = "fastdds";  ///< vendor, or mixed
  std::string users_dds = {};   ///< vendor of the users' programs; empty: as `dds`
  int domain = 70;
};

/// One run of the real programs in real time, with the world and each user on a host of their own, between which a link
/// is emulated (`subworld up --namespaces`).
struct LinkedRun {
  Json summary;                   ///< of the run
  std::vector<FeltHistory> felt;  ///< by user; force and on_operator only, on the reference's haptic steps
  std::vector<double> start_s;    ///< by user: simulated time at which the device started its path
  Outcome reference;              ///< of the same motions
  int attempts = 1;               ///< runs that were made, this one is the best
  std::string disturbed = {};     ///< gate that this machine missed, with its value; empty: none
};

/// Throws `Error` (failed), with the cure, where this process may not emulate a network: before the minutes that other
/// searches of a lab take.
void require_link_rights();

/// In real time a device starts its path when its haptic process first answers. That instant differs between users, and
/// the device's clock may fall behind later. So the reference is run with the same motions: each corner of a path is at
/// the simulated time at which the haptic process had it from the device.
///
/// The scene is the point's file: variants, boxes, budgets, delays, stiffness factors and later starts of a point have
/// no flags and are not used. Empty if a signal requested a stop. Throws `Error` (failed) with the launcher's message
/// where the run failed.
[[nodiscard]] std::optional<LinkedRun> run_over_link(const Point& point, const OverLink& over);

/// The first of at most four runs that the machine has not disturbed: no gate is missed, or only by the network, the
/// engine or the scene. If there is none, the run whose programs were late the least often. A busy machine delays the
/// programs too; that is not the link's delay.
[[nodiscard]] std::optional<LinkedRun> undisturbed_run_over_link(const Point& point, const OverLink& over);

/// The clock of a device, as its haptic process saw it.
struct DeviceClock {
  std::vector<double> time_s;    ///< simulated time at the begin of each haptic step; ascending
  std::vector<double> device_s;  ///< time stamp of the device state that the step used

  /// Simulated time at which the device left `device_time_s` of its path. Linear between the steps; before the first
  /// and behind the last one the clocks run alike.
  [[nodiscard]] double time_of(double device_time_s) const noexcept;
};

}  // namespace subworld
