#pragma once

#include "io/ending.hpp"
#include "io/options/machine_share.hpp"
#include "io/results/results.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace subworld {

// What the programs write at their end, and the launcher reads. The keys are the names of the members; deploy/README.md
// says what each means.

struct OperatorEnergy {
  double net_j = 0.0, least_j = 0.0, created_j = 0.0;
};
SUBWORLD_HAS_JSON(OperatorEnergy)

struct SelectionResult {
  std::size_t user = 0;
  MeanMax omitted;
  double expected_step_s = 0.0, cost_factor = 1.0;
};
SUBWORLD_HAS_JSON(SelectionResult)

struct BodyHistoryResult {
  std::string file = "bodies.csv";
  std::size_t bodies = 0;
  double interval_s = 0.0;
  std::uint64_t rows = 0, rows_dropped = 0;
};
SUBWORLD_HAS_JSON(BodyHistoryResult)

/// Checkpoints of the world. `copy_s`: in the loop, of those cycles that copy the world; `cycle_share`: part of the
/// time of all cycles that checkpoints take.
struct CheckpointResult {
  double interval_s = 0.0;
  std::uint64_t written = 0, skipped = 0, failed = 0;
  std::size_t bytes = 0;
  double newest_s = 0.0;
  MeanMax copy_s, write_s;
  double cycle_share = 0.0;
  std::string fault;
};
SUBWORLD_HAS_JSON(CheckpointResult)

struct WorldRefused {
  std::uint64_t haptic_report = 0, scene = 0;
  std::string by;  ///< the programs that wrote them, as far as they are known
};
SUBWORLD_HAS_JSON(WorldRefused)

/// A user who did not take part for some time; at the end of the run, `to_s` is its end.
struct Absence {
  std::size_t user = 0;
  double from_s = 0.0, to_s = 0.0;
  bool by_order = false;
};
SUBWORLD_HAS_JSON(Absence)

struct WorldResult {
  std::size_t bodies = 0;
  std::uint64_t cycles = 0;
  MeanMax ratio;
  std::uint64_t ratio_changes = 0;
  MeanMax substeps;
  double integration_substep_s = 0.0;
  std::uint64_t late_cycles = 0, late_by_os = 0, late_by_run = 0;
  Quantiles woken_late_s = {};
  MachineShare machine = {};
  Quantiles step_s = {};
  StageTimes stages = {};
  Quantiles lateness_s;
  double real_time_factor_min = 1.0, real_time_factor_mean = 1.0;
  double slowed_s = 0.0, stuck_s = 0.0;
  double released_j = 0.0, operators_created_j = 0.0, contact_slack_j = 0.0;
  std::size_t asleep_at_end = 0;
  std::vector<SelectionResult> selections = {};
  std::uint64_t lost_reports = 0, refused_reports = 0;
  std::vector<Absence> absences = {};
  std::string presence = {};  ///< who joined, left and missed whom in lock-step (model/presence)
  std::vector<EngineChange> engine_changes = {};
  double settle_wall_s = 0.0;
  std::uint64_t history_rows_dropped = 0, trace_events_dropped = 0;
  std::optional<BodyHistoryResult> body_history = {};
  std::optional<CheckpointResult> checkpoints = {};
  std::optional<double> resumed_from_s = {};
  std::string dds = {};
  EventCounts events = {};
  WorldRefused refused = {};
};
SUBWORLD_HAS_JSON(WorldResult)

/// The file of world_sim.
struct WorldPart {
  std::string state_hash;
  double simulated_s = 0.0;
  double energy_excess_j = 0.0;
  WorldResult world;
  Ending ending = {};
  std::string host = {};
  std::vector<std::string> arguments = {};  ///< scene and flags, from which others know the run
};
SUBWORLD_HAS_JSON(WorldPart)

struct HapticRefused {
  std::uint64_t device_state = 0, world_frame = 0;
  std::string by;
};
SUBWORLD_HAS_JSON(HapticRefused)

/// The file of a haptic_sim.
struct HapticResult {
  std::size_t user = 0;
  std::uint64_t steps = 0, skipped_steps = 0;
  std::uint64_t missed_deadlines = 0, missed_by_os = 0, missed_by_run = 0, missed_waiting = 0;
  Quantiles lateness_s;
  Quantiles woken_late_s = {};
  MachineShare machine = {};
  Quantiles step_s = {};
  StageTimes stages = {};
  double force_rms_n = 0.0, force_max_n = 0.0, force_step_mean_n = 0.0, force_step_max_n = 0.0;
  double at_limit_ratio = 0.0;
  double proxy_apart_max_m = 0.0;
  double coupling_force_rms_n = 0.0, coupling_force_max_n = 0.0;
  MeanMax members, contacts, border_pairs;
  Quantiles sync_s, round_trip_s;
  double bytes_per_cycle = 0.0;
  double sent_ratio = 1.0;
  OperatorEnergy operator_energy;
  double device_work_j = 0.0;
  double oscillation_n = 0.0;
  std::uint64_t device_jumps = 0;
  double late_reports_ratio = 0.0;
  std::uint64_t lost_frames = 0, refused_frames = 0, resynchronisations = 0;
  std::vector<EngineChange> engine_changes = {};
  std::uint64_t history_rows_dropped = 0, trace_events_dropped = 0;
  std::string dds = {};
  EventCounts events = {};
  HapticRefused refused = {};
  Ending ending = {};
  std::string host = {};
};
SUBWORLD_HAS_JSON(HapticResult)

struct DeviceRefused {
  std::uint64_t device_command = 0;
  std::uint64_t forged_command = 0;  ///< in the name of the haptic process
  std::string by;
};
SUBWORLD_HAS_JSON(DeviceRefused)

/// A real device, by its driver. `absent_s`: total time in which the device was lost or had no good reading.
struct DriverResult {
  std::string name, version;
  std::uint64_t readings = 0, refused = 0;
  std::string refused_for;  ///< numbers and reasons
  std::uint64_t absences = 0;
  double absent_s = 0.0, longest_gap_s = 0.0;
};
SUBWORLD_HAS_JSON(DriverResult)

/// The file of a device_sim.
struct DeviceResult {
  std::size_t user = 0;
  std::uint64_t steps = 0;
  Quantiles round_trip_s;
  double sent_ratio = 1.0;
  std::uint64_t missed_deadlines = 0, missed_by_os = 0, missed_by_run = 0;
  Quantiles step_s = {};
  OperatorEnergy operator_energy;
  double energy_bounded_ratio = 0.0;
  double oscillation_n = 0.0;
  Quantiles woken_late_s = {};
  MachineShare machine = {};
  StageTimes stages = {};
  std::uint64_t history_rows_dropped = 0, trace_events_dropped = 0;
  std::string dds = {};
  EventCounts events = {};
  DeviceRefused refused = {};
  std::optional<DriverResult> driver = {};  ///< none: the emulated device
  Ending ending = {};
  std::string host = {};
};
SUBWORLD_HAS_JSON(DeviceResult)

/// Writes the file of a program's part, as write_json() does.
void write_part(const std::string& path, const WorldPart& part);
void write_part(const std::string& path, const HapticResult& part);
void write_part(const std::string& path, const DeviceResult& part);

}  // namespace subworld
