#include "io/results/program_results.hpp"

#include "io/results/json.hpp"

namespace subworld {

SUBWORLD_JSON(MachineShare, scheduling, fifo, memory_locked, cpu_s, run_queue_delay_s, involuntary_switches,
              voluntary_switches, stolen_s)
SUBWORLD_JSON(OperatorEnergy, net_j, least_j, created_j)
SUBWORLD_JSON(SelectionResult, user, omitted, expected_step_s, cost_factor)
SUBWORLD_JSON(BodyHistoryResult, file, bodies, interval_s, rows, rows_dropped)
SUBWORLD_JSON(CheckpointResult, interval_s, written, skipped, failed, bytes, newest_s, copy_s, write_s, cycle_share,
              fault)
SUBWORLD_JSON(WorldRefused, haptic_report, scene, by)
SUBWORLD_JSON(Absence, user, from_s, to_s, by_order)
SUBWORLD_JSON(WorldResult, bodies, cycles, ratio, ratio_changes, substeps, integration_substep_s, late_cycles,
              late_by_os, late_by_run, woken_late_s, machine, step_s, stages, lateness_s, real_time_factor_min,
              real_time_factor_mean, slowed_s, stuck_s, released_j, operators_created_j, contact_slack_j, asleep_at_end,
              selections, lost_reports, refused_reports, absences, presence, engine_changes, settle_wall_s,
              history_rows_dropped, trace_events_dropped, body_history, checkpoints, resumed_from_s, dds, events,
              refused)
SUBWORLD_JSON(WorldPart, state_hash, simulated_s, energy_excess_j, world, ending, host, arguments)
SUBWORLD_JSON(HapticRefused, device_state, world_frame, by)
SUBWORLD_JSON(HapticResult, user, steps, skipped_steps, missed_deadlines, missed_by_os, missed_by_run, missed_waiting,
              lateness_s, woken_late_s, machine, step_s, stages, force_rms_n, force_max_n, force_step_mean_n,
              force_step_max_n, at_limit_ratio, proxy_apart_max_m, coupling_force_rms_n, coupling_force_max_n, members,
              contacts, border_pairs, sync_s, round_trip_s, bytes_per_cycle, sent_ratio, operator_energy, device_work_j,
              oscillation_n, device_jumps, late_reports_ratio, lost_frames, refused_frames, resynchronisations,
              engine_changes, history_rows_dropped, trace_events_dropped, dds, events, refused, ending, host)
SUBWORLD_JSON(DeviceRefused, device_command, forged_command, by)
SUBWORLD_JSON(DriverResult, name, version, readings, refused, refused_for, absences, absent_s, longest_gap_s)
SUBWORLD_JSON(DeviceResult, user, steps, round_trip_s, sent_ratio, missed_deadlines, missed_by_os, missed_by_run,
              step_s, operator_energy, energy_bounded_ratio, oscillation_n, woken_late_s, machine, stages,
              history_rows_dropped, trace_events_dropped, dds, events, refused, driver, ending, host)

void write_part(const std::string& path, const WorldPart& part) { write_json(path, part); }
void write_part(const std::string& path, const HapticResult& part) { write_json(path, part); }
void write_part(const std::string& path, const DeviceResult& part) { write_json(path, part); }

}  // namespace subworld
