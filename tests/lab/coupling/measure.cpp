#include "lab/coupling/measure.hpp"

#include "lab/coupling/analysis.hpp"
#include "rt/stop.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace subworld {

namespace {

constexpr int kFiner = 4;  ///< refinement of the step for the error of the reference
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

std::vector<Vec3> every(std::span<const Vec3> values, int step) {
  std::vector<Vec3> kept;
  for (std::size_t i = 0; i < values.size(); i += static_cast<std::size_t>(step)) kept.push_back(values[i]);
  return kept;
}

/// Forces of all users, concatenated; each is cut to the length that both runs have. `finer`: steps of b in one of a.
struct Joined {
  std::vector<Vec3> a;
  std::vector<Vec3> b;
};
Joined joined(const std::vector<FeltHistory>& a, const std::vector<FeltHistory>& b, int finer = 1) {
  Joined both;
  for (std::size_t u = 0; u < a.size(); ++u) {
    const std::vector<Vec3> of_b = every(b[u].force, finer);
    const auto n = static_cast<std::ptrdiff_t>(std::min(a[u].force.size(), of_b.size()));
    both.a.insert(both.a.end(), a[u].force.begin(), a[u].force.begin() + n);
    both.b.insert(both.b.end(), of_b.begin(), of_b.begin() + n);
  }
  return both;
}

double position_error_rms_m(const std::vector<FeltHistory>& a, const std::vector<FeltHistory>& b) {
  double sum = 0.0;
  std::size_t count = 0;
  for (std::size_t u = 0; u < a.size(); ++u) {
    const std::size_t n = std::min(a[u].proxy.size(), b[u].proxy.size());
    for (std::size_t i = 0; i < n; ++i) sum += (a[u].proxy[i].position - b[u].proxy[i].position).squaredNorm();
    count += n;
  }
  return std::sqrt(sum / static_cast<double>(count));
}

double drift_max_m(const Scene& scene, const Outcome& a, const Outcome& b) {
  double most = 0.0;
  for (const Body& body : scene.bodies) {
    if (body.fixed()) continue;
    const double drift = (a.end[index(body.id)].position - b.end[index(body.id)].position).norm();
    if (!(drift <= most)) most = drift;  // a value that is not a number stays
    if (std::isnan(most)) break;
  }
  return most;
}

double cpu_s_per_s(const Histogram& h, double simulated_s) {
  return h.mean_s() * static_cast<double>(h.count()) / simulated_s;
}

/// Settings of the run.
Json settings_of(const Point& point, const Scene& scene, const Outcome& run) {
  const Settings& s = scene.settings;
  return {{"scene", scene.name},
          {"variant", point.variant},
          {"scheme", point.scheme},
          {"engine", s.world.name},
          {"haptic_engine", s.haptic.name},
          {"h_s", s.h_s},
          {"ratio", s.ratio},
          {"ratio_most", point.ratio_most},
          {"ratio_mean", run.ratio.mean()},
          {"box_m", scene.users.front().box_half_m},
          {"contact_depth", scene.users.front().contact_depth},
          {"budget_ratio", scene.users.front().budget_ratio},
          {"world_substeps", run.substeps},
          {"latency_s", point.latency_s},
          {"jitter_s", point.jitter_s},
          {"coupling_stiffness_n_m", scene.users.front().coupling.stiffness_n_m}};
}

constexpr ForceError kNoError{kNone, kNone, kNone, kNone, kNone, kNone, kNone};

Json errors_of(const ForceError& e, double reference_error) {
  return {{"force_error_rms", e.rms},
          {"force_error_p99", e.p99},
          {"force_error_max", e.max},
          {"time_offset_s", e.time_offset_s},
          {"value_offset", e.value_offset},
          {"jitter_ratio", e.jitter_ratio},
          {"smoothed_force_error_rms", e.smoothed_rms},
          {"reference_error", reference_error}};
}

/// RMS error of the felt torque; of a device with three degrees of freedom there is none.
double torque_error_rms(const UserSpec& user, const FeltHistory& run, const FeltHistory& reference, double h_s) {
  return user.device.degrees_of_freedom == 6 ? force_error(run.torque, reference.torque, h_s).rms : kNone;
}

/// A row of each user; and the worst one's in the row of all.
std::vector<Json> add_users(Json& row, const Json& settings, const Scene& scene, const Outcome& run,
                            const Reference& reference) {
  std::vector<ForceError> errors(run.felt.size(), kNoError);
  if (run.finite) errors = force_errors(run.felt, reference.run.felt, scene.settings.h_s);
  std::vector<Json> users;
  std::size_t worst = 0;
  double worst_torque = kNone;
  for (std::size_t u = 0; u < errors.size(); ++u) {
    users.push_back(settings);
    users.back().update({{"user", u}, {"user_name", scene.users[u].name}});
    users.back().update(errors_of(errors[u], reference.errors[u]));
    const double torque_error =
        torque_error_rms(scene.users[u], run.felt[u], reference.run.felt[u], scene.settings.h_s);
    users.back().update({{"torque_error_rms", torque_error}});
    if (!(torque_error <= worst_torque) && !std::isnan(torque_error)) worst_torque = torque_error;
    if (!(errors[u].rms <= errors[worst].rms)) worst = u;  // a value that is not a number stays
  }
  row.update({{"worst_user", worst},
              {"worst_user_force_error_rms", errors[worst].rms},
              {"worst_user_reference_error", reference.errors[worst]},
              {"torque_error_rms", worst_torque}});
  return users;
}

void add_errors(Json& row, const Scene& scene, const Outcome& run, const Reference& reference) {
  const ForceError e = run.finite ? force_error(run.felt, reference.run.felt, scene.settings.h_s) : kNoError;
  const double drift_m = run.finite ? drift_max_m(scene, run, reference.run) : kNone;
  row.update(errors_of(e, reference.error));
  row.update({{"survived", run.finite && std::isfinite(drift_m)},
              {"position_error_rms_m", run.finite ? position_error_rms_m(run.felt, reference.run.felt) : kNone},
              {"drift_max_m", drift_m},
              {"energy_excess_j", run.energy_excess_j},
              {"reference_energy_excess_j", reference.run.energy_excess_j},
              {"device_work_j", run.device_work_j},
              {"at_reference_error", e.rms <= reference.error && usable(reference.error)}});
}

void add_run_times(Json& row, const Outcome& run) {
  row.update({{"members_mean", run.members.mean()},
              {"ghosts_mean", run.ghosts.mean()},
              {"border_pairs_mean", run.border_pairs.mean()},
              {"world_cpu_s_per_s", cpu_s_per_s(run.cpu.world, run.simulated_s)},
              {"haptic_cpu_s_per_s", cpu_s_per_s(run.cpu.haptic, run.simulated_s)},
              {"synchronise_cpu_s_per_s", cpu_s_per_s(run.cpu.synchronise, run.simulated_s)},
              {"transport_cpu_s_per_s", nullptr},
              {"world_step_s", quantiles(run.cpu.world)},
              {"haptic_step_s", quantiles(run.cpu.haptic)},
              {"synchronise_step_s", quantiles(run.cpu.synchronise)}});
}

}  // namespace

std::optional<Outcome> run_out(const Scene& scene) {
  const auto run = std::make_unique<CoupledRun>(scene);
  Outcome out;
  while (run->finite() && !run->world.facts().over) {
    if (stop_signal() != 0) return std::nullopt;
    const std::uint64_t stamp = run->world.facts().stamp;
    run->cycle();
    if (run->world.facts().stamp > stamp) {
      out.ratio.add(run->world.facts().ratio);
      out.ratios.insert(out.ratios.end(), static_cast<std::size_t>(run->world.facts().ratio), run->world.facts().ratio);
    }
    for (std::size_t u = 0; u < run->subs.size(); ++u) {
      const WorldFrame& frame = run->frame(u);
      out.members.add(static_cast<double>(frame.members.size()));
      out.ghosts.add(static_cast<double>(frame.ghosts.size()));
      out.border_pairs.add(static_cast<double>(run->world.user_facts(u).border.size()));
    }
  }
  out.finite = run->finite();
  out.simulated_s = run->world.facts().time_s;
  out.substeps = run->world.facts().substeps;
  out.energy_excess_j = run->world.facts().energy_excess_j;
  for (const auto& sub : run->subs) out.device_work_j += sub->facts().device_work_j;
  for (const Body& body : scene.bodies) out.end.push_back(run->world.engine().state(body.id));
  out.felt = std::move(run->felt);
  out.cpu = run->cpu;
  return out;
}

std::optional<Reference> reference_of(const Scene& scene) {
  std::optional<Outcome> run = run_out(scene);
  if (!run) return std::nullopt;
  const std::optional<Outcome> fine = run_out(refined(scene, kFiner));
  if (!fine) return std::nullopt;
  const Joined both = joined(run->felt, fine->felt, kFiner);
  const double error = force_error(both.a, both.b, scene.settings.h_s).rms;
  std::vector<double> errors;
  for (const ForceError& e : force_errors(run->felt, fine->felt, scene.settings.h_s, kFiner)) errors.push_back(e.rms);
  return Reference{std::move(*run), error, std::move(errors)};
}

ForceError force_error(const std::vector<FeltHistory>& felt, const std::vector<FeltHistory>& reference, double h_s) {
  const Joined both = joined(felt, reference);
  return force_error(both.a, both.b, h_s);
}

std::vector<ForceError> force_errors(const std::vector<FeltHistory>& felt, const std::vector<FeltHistory>& reference,
                                     double h_s, int finer) {
  std::vector<ForceError> errors;
  for (std::size_t u = 0; u < felt.size(); ++u) {
    const Joined both = joined({felt[u]}, {reference[u]}, finer);
    errors.push_back(force_error(both.a, both.b, h_s));
  }
  return errors;
}

const Reference* References::of(const Point& point) {
  const std::string key = reference_key(point);
  if (const auto found = known_.find(key); found != known_.end()) return &found->second;
  std::optional<Reference> reference = reference_of(reference_scene_of(point));
  return reference ? &known_.emplace(key, std::move(*reference)).first->second : nullptr;
}

std::optional<Measured> measure(const Point& point, References& references) {
  const Reference* reference = references.of(point);
  if (reference == nullptr) return std::nullopt;
  const Scene scene = scene_of(point);
  const std::optional<Outcome> run = run_out(scene);
  if (!run) return std::nullopt;

  const Json settings = settings_of(point, scene, *run);
  Measured measured{.row = settings, .users = {}, .traces = {}};
  add_errors(measured.row, scene, *run, *reference);
  measured.users = add_users(measured.row, settings, scene, *run, *reference);
  add_run_times(measured.row, *run);
  const std::string late = point.latency_s > 0.0 ? fmt::format("_late_{:g}_ms", 1e3 * point.latency_s) : "";
  const std::string substeps = run->substeps > 1 ? fmt::format("_{}_substeps", run->substeps) : "";
  for (std::size_t u = 0; u < run->felt.size(); ++u) {
    const std::string of_user = run->felt.size() > 1 ? fmt::format("_user_{}", u) : "";
    Trace& trace = measured.traces.emplace_back(
        Trace{.scene = scene.name,
              .user = u,
              .scheme = point.scheme,
              .ratio = point.ratio,
              .latency_s = point.latency_s,
              .name = fmt::format("{}_{}_r{}{}{}{}", scene.name, point.scheme, point.ratio, substeps, late, of_user),
              .h_s = scene.settings.h_s,
              .force = run->felt[u].force,
              .reference = reference->run.felt[u].force,
              .ratios = run->ratios});
    const std::size_t n = std::min(trace.force.size(), trace.reference.size());
    trace.force.resize(n);
    trace.reference.resize(n);
    trace.ratios.resize(n, scene.settings.ratio);
  }
  return measured;
}

double total_cpu(const Json& row) {
  double sum = 0.0;
  for (const char* part : {"world_cpu_s_per_s", "haptic_cpu_s_per_s", "synchronise_cpu_s_per_s"})
    sum += row.at(part).get<double>();
  return sum;
}

}  // namespace subworld
