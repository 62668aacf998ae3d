#include "lab/coupling/measure.hpp"

#include "io/results/json.hpp"
#include "lab/coupling/analysis.hpp"
#include "lab/coupling/mutual.hpp"
#include "lab/session/etvo.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace subworld {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

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

double cpu_s_per_s(const Histogram& h, double simulated_s) {
  return h.mean_s() * static_cast<double>(h.count()) / simulated_s;
}

/// Settings of the run. Columns of later results begin with "force_error_rms" (lab/analysis).
Json settings_of(const Point& point, Scene scene, const Outcome& run) {
  Settings& s = scene.settings;
  Json row{{"scene", scene.name},
           {"variant", point.variant},
           {"scheme", point.scheme},
           {"ratio", s.ratio},
           {"ratio_most", point.ratio_most},
           {"ratio_mean", run.ratio.mean()},
           {"world_substeps", run.substeps},
           {"oracle", point.oracle}};
  const auto add = [&](const std::string& column, std::string_view key) {
    const Setting& setting = *find_setting(key);
    row[column] = json_of(setting, s, scene.users.front());
  };
  for (const auto& [column, key] : usual_columns()) add(std::string(column), key);
  row["latency_s"] = s.delay.up_s + s.delay.down_s;
  row["device_latency_s"] = s.delay.from_device_s + s.delay.to_device_s;
  for (const SettingChange& one : point.settings) {
    if (const std::string column = column_of(one.key); !row.contains(column)) add(column, one.key);
  }
  return row;
}

constexpr ForceError kNoError{kNone, kNone, kNone, kNone, kNone, kNone, kNone};

Json errors_of(const ForceError& e, double reference_error, double causal_error) {
  return {{"force_error_rms", e.rms},
          {"force_error_p99", e.p99},
          {"force_error_max", e.max},
          {"time_offset_s", e.time_offset_s},
          {"value_offset", e.value_offset},
          {"jitter_ratio", e.jitter_ratio},
          {"smoothed_force_error_rms", e.smoothed_rms},
          {"reference_error", reference_error},
          {"causal_error", causal_error},
          {"at_bound", at_bound(e.rms, reference_error, causal_error)}};
}

constexpr Etvo kNoEtvo{kNone, kNone, kNone, kNone};

Json etvo_of(const Etvo& e) {
  return {{"etvo_time_s", {{"p50", e.time_p50_s}, {"p99", e.time_p99_s}}},
          {"etvo_value_n", {{"p50", e.value_p50_n}, {"p99", e.value_p99_n}}}};
}

/// The largest of each.
void add(Etvo& worst, const Etvo& e) {
  for (double Etvo::*part : {&Etvo::time_p50_s, &Etvo::time_p99_s, &Etvo::value_p50_n, &Etvo::value_p99_n}) {
    if (!(e.*part <= worst.*part) && !std::isnan(e.*part)) worst.*part = e.*part;
  }
}

Json on_operator_errors_of(const ForceError& e) {
  return {{"operator_force_error_rms", e.rms},
          {"operator_force_error_p99", e.p99},
          {"operator_time_offset_s", e.time_offset_s}};
}

/// `created_ratio`: energy that the coupling created, beyond that of the reference, as a share of the users' work.
Json balance_of(double created_j, double reference_created_j, double work_j, const MomentumBalance& momentum) {
  const double more_j = std::max(0.0, created_j - reference_created_j);
  return {{"created_j", created_j},
          {"reference_created_j", reference_created_j},
          {"created_ratio", work_j > 0.0 ? more_j / work_j : kNone},
          {"momentum_error_ratio", momentum.error_ratio()}};
}

Json copies_of(const CopyDifference& copies) {
  return {{"copies_rms_m", copies.rms_m()}, {"copies_max_m", copies.max_m()}};
}

Json mutual_of(const std::optional<MutualLatency>& late) {
  return {{"mutual_latency_s", late ? Json(late->late_s) : Json(nullptr)},
          {"mutual_latency_of_user", late ? Json(late->of_user) : Json(nullptr)},
          {"reference_mutual_latency_s", late ? Json(late->reference_s) : Json(nullptr)}};
}

double work_j(const Outcome& run) {
  double sum = 0.0;
  for (const FeltHistory& user : run.felt) sum += user.work_j;
  return sum;
}

void add_balance(Json& row, const Outcome& run, const Reference& reference) {
  double created_j = 0.0, reference_created_j = 0.0;
  CopyDifference copies;
  for (const UserBalance& user : reference.run.balance) reference_created_j += user.created_j;
  for (const UserBalance& user : run.balance) {
    created_j += user.created_j;
    copies.add(user.copies);
  }
  row.update(balance_of(created_j, reference_created_j, work_j(run), run.momentum));
  row.update(copies_of(copies));
}

/// RMS error of the felt torque; of a device with three degrees of freedom there is none.
double torque_error_rms(const UserSpec& user, const FeltHistory& run, const FeltHistory& reference, double h_s) {
  return user.device.degrees_of_freedom == 6 ? force_error(run.torque, reference.torque, h_s).rms : kNone;
}

/// A row of each user; and the worst one's in the row of all.
std::vector<Json> add_users(Json& row, const Json& settings, const Scene& scene, const Outcome& run,
                            const Reference& reference, const CausalErrors& causal) {
  std::vector<ForceError> errors(run.felt.size(), kNoError), on_operator = errors;
  if (run.finite) {
    errors = force_errors(run.felt, reference.run.felt, scene.settings.h_s);
    on_operator = force_errors(run.felt, reference.run.felt, scene.settings.h_s, &FeltHistory::on_operator);
  }
  std::vector<Json> users;
  std::size_t worst = 0;
  double worst_torque = kNone;
  Etvo worst_etvo = kNoEtvo;
  for (std::size_t u = 0; u < errors.size(); ++u) {
    users.push_back(settings);
    users.back().update({{"user", u}, {"user_name", scene.users[u].name}});
    users.back().update(errors_of(errors[u], reference.errors[u].rms, causal.by_user[u]));
    users.back().update(on_operator_errors_of(on_operator[u]));
    const Etvo offsets =
        run.finite ? etvo(run.felt[u].force, reference.run.felt[u].force, scene.settings.h_s) : kNoEtvo;
    users.back().update(etvo_of(offsets));
    add(worst_etvo, offsets);
    const UserBalance& balance = run.balance[u];
    users.back()["work_j"] = run.felt[u].work_j;
    users.back().update(
        balance_of(balance.created_j, reference.run.balance[u].created_j, work_j(run), balance.momentum));
    users.back().update(copies_of(balance.copies));
    users.back()["bounded_ratio"] = balance.bounded_ratio;
    const double torque_error =
        torque_error_rms(scene.users[u], run.felt[u], reference.run.felt[u], scene.settings.h_s);
    users.back()["torque_error_rms"] = torque_error;
    if (!(torque_error <= worst_torque) && !std::isnan(torque_error)) worst_torque = torque_error;
    if (!(errors[u].rms <= errors[worst].rms)) worst = u;  // a value that is not a number stays
  }
  row.update({{"worst_user", worst},
              {"worst_user_force_error_rms", errors[worst].rms},
              {"worst_user_reference_error", reference.errors[worst].rms},
              {"worst_user_causal_error", causal.by_user[worst]},
              {"torque_error_rms", worst_torque}});
  row.update(etvo_of(worst_etvo));
  return users;
}

void add_errors(Json& row, const Scene& scene, const Outcome& run, const Reference& reference, double causal_error) {
  const ForceError e = run.finite ? force_error(run.felt, reference.run.felt, scene.settings.h_s) : kNoError;
  const ForceError on_operator =
      run.finite ? force_error(run.felt, reference.run.felt, scene.settings.h_s, &FeltHistory::on_operator) : kNoError;
  const double drift_m = run.finite ? drift_max_m(scene, run.end, reference.run.end) : kNone;
  row.update(errors_of(e, reference.error, causal_error));
  row.update(on_operator_errors_of(on_operator));
  add_balance(row, run, reference);
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
              {"device_sent_ratio", run.device_sent_ratio},
              {"world_cpu_s_per_s", cpu_s_per_s(run.cpu.world, run.simulated_s)},
              {"haptic_cpu_s_per_s", cpu_s_per_s(run.cpu.haptic, run.simulated_s)},
              {"synchronise_cpu_s_per_s", cpu_s_per_s(run.cpu.synchronise, run.simulated_s)},
              {"transport_cpu_s_per_s", nullptr},
              {"world_step_s", quantiles(run.cpu.world)},
              {"haptic_step_s", quantiles(run.cpu.haptic)},
              {"synchronise_step_s", quantiles(run.cpu.synchronise)}});
}

}  // namespace

Prepare prepare_of(const Point& point) {
  if (point.oracle == "off") return {};
  return [](CoupledRun& run) { run.know_peers_at_once(); };
}

std::optional<Outcome> run_out(const Scene& scene, const Prepare& prepare) {
  const auto run = std::make_unique<CoupledRun>(scene);
  if (prepare) prepare(*run);
  Outcome out;
  BalanceWatch balance(*run, scene);
  while (run->finite() && !run->world.facts().over) {
    if (stop_signal() != 0) return std::nullopt;
    const std::uint64_t stamp = run->world.facts().stamp;
    run->cycle();
    if (run->world.facts().stamp > stamp) {
      out.ratio.add(run->world.facts().ratio);
      out.ratios.insert(out.ratios.end(), static_cast<std::size_t>(run->world.facts().ratio), run->world.facts().ratio);
      balance.observe();
    }
    for (std::size_t u = 0; u < run->subs.size(); ++u) {
      const WorldFrame& frame = run->frame(u);
      out.members.add(static_cast<double>(frame.members.size()));
      out.ghosts.add(static_cast<double>(run->world.user_facts(u).outside));
      out.border_pairs.add(static_cast<double>(run->world.user_facts(u).border.size()));
    }
  }
  out.finite = run->finite();
  out.simulated_s = run->world.facts().time_s;
  out.substeps = run->world.facts().substeps;
  out.energy_excess_j = run->world.facts().energy_excess_j;
  for (const auto& sub : run->subs) out.device_work_j += sub->facts().device_work_j;
  out.balance = balance.by_user(scene.settings.h_s);
  for (const UserBalance& user : out.balance) out.momentum.add(user.momentum);
  for (const Body& body : scene.bodies) out.end.push_back(run->world.engine().state(body.id));
  MeanMax sent;
  for (std::size_t u = 0; u < run->subs.size(); ++u) sent.add(run->device_sent_ratio(u));
  if (!run->subs.empty()) out.device_sent_ratio = sent.mean();
  out.felt = std::move(run->felt);
  out.cpu = run->cpu;
  return out;
}

double drift_max_m(const Scene& scene, const std::vector<BodyState>& a, const std::vector<BodyState>& b) {
  double most = 0.0;
  for (const Body& body : scene.bodies) {
    if (body.fixed()) continue;
    const double drift = (a[index(body.id)].position - b[index(body.id)].position).norm();
    if (!(drift <= most)) most = drift;  // a value that is not a number stays
    if (std::isnan(most)) break;
  }
  return most;
}

ForceError force_error(const std::vector<FeltHistory>& felt, const std::vector<FeltHistory>& reference, double h_s,
                       ForceOf force) {
  std::vector<ForcePair> users;
  for (std::size_t u = 0; u < felt.size(); ++u) users.push_back({felt[u].*force, reference[u].*force});
  return force_error(users, h_s);
}

std::vector<ForceError> force_errors(const std::vector<FeltHistory>& felt, const std::vector<FeltHistory>& reference,
                                     double h_s, ForceOf force) {
  std::vector<ForceError> errors;
  for (std::size_t u = 0; u < felt.size(); ++u) errors.push_back(force_error(felt[u].*force, reference[u].*force, h_s));
  return errors;
}

std::optional<Measured> measure(const Point& point, References& references, MutualLatencies* mutual) {
  const Reference* reference = references.of(point);
  if (reference == nullptr) return std::nullopt;
  const CausalErrors* const causal = references.causal_of(point);
  if (causal == nullptr) return std::nullopt;
  const Scene scene = scene_of(point);
  const std::optional<Outcome> run = run_out(scene, prepare_of(point));
  if (!run) return std::nullopt;

  const Json settings = settings_of(point, scene, *run);
  Measured measured{.row = settings, .users = {}, .traces = {}};
  add_errors(measured.row, scene, *run, *reference, causal->all);
  measured.users = add_users(measured.row, settings, scene, *run, *reference, *causal);
  add_run_times(measured.row, *run);
  std::vector<std::optional<MutualLatency>> latencies(run->felt.size());
  if (mutual != nullptr && run->finite && !mutual->measure(point, *run, *reference, latencies)) return std::nullopt;
  for (std::size_t u = 0; u < latencies.size(); ++u) measured.users[u].update(mutual_of(latencies[u]));
  const double latency_s = settings.at("latency_s");
  const std::string late = latency_s > 0.0 ? fmt::format("_late_{:g}_ms", 1e3 * latency_s) : "";
  const std::string substeps = run->substeps > 1 ? fmt::format("_{}_substeps", run->substeps) : "";
  for (std::size_t u = 0; u < run->felt.size(); ++u) {
    const std::string of_user = run->felt.size() > 1 ? fmt::format("_user_{}", u) : "";
    Trace& trace = measured.traces.emplace_back(
        Trace{.scene = scene.name,
              .user = u,
              .scheme = point.scheme,
              .ratio = point.ratio,
              .latency_s = latency_s,
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
