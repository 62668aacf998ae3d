#include "lab/plan/measure.hpp"

#include "coupling/plan.hpp"
#include "io/results/json.hpp"
#include "lab/coupling/measure.hpp"
#include "lab/coupling/sweep.hpp"
#include "lab/session/apart.hpp"
#include "lab/session/coupled_run.hpp"
#include "lab/session/cpu_time.hpp"
#include "model/error.hpp"
#include "model/shapes/shape_extent.hpp"
#include "wire/codec/codec.hpp"

#include <fmt/core.h>
#include <malloc.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace subworld {

namespace {

constexpr double kMost_s = 600.0;  ///< for a run
constexpr double kNotMeasured = NAN;
/// Difference of places that is none, as a part of the smallest body's radius: a body at rest may creep as far.
constexpr double kSamePlace = 0.02;

/// The compared figures, and the columns of their ratios.
struct Figure {
  const char* key;
  const char* ratio;
};
constexpr std::array kFigures{Figure{"world_cpu_s", "world_cpu_ratio"}, Figure{"haptic_cpu_s", "haptic_cpu_ratio"},
                              Figure{"bytes_per_cycle", "bytes_ratio"}, Figure{"memory_bytes", "memory_ratio"},
                              Figure{"start_cpu_s", "start_ratio"}};

double allocated_bytes() {
  const struct mallinfo2 heap = mallinfo2();
  return static_cast<double>(heap.uordblks + heap.hblkhd);
}

/// Time that reading the clock twice adds to a measurement, s: as much as a step of a single proxy.
double clock_s() {
  constexpr int kTimes = 20'000;
  Histogram nothing;
  for (int i = 0; i < kTimes; ++i) const CpuTimer timer(nothing);
  return nothing.quantile_s(0.5);
}

double sum_s(const Histogram& times, double clock_s) {
  return times.sum_s() - clock_s * static_cast<double>(times.count());
}

/// Measured in a child process.
Json figures_of(const Scene& scene) {
  const double before_bytes = allocated_bytes(), before_s = thread_cpu_s();
  CoupledRun run(scene);
  const double start_s = thread_cpu_s() - before_s;
  std::vector<Codec<WorldFrame>> frames(run.subs.size());  // by user, as the programs' writers
  std::vector<Codec<HapticReport>> reports(run.subs.size());
  double bytes = 0.0;
  std::uint64_t cycles = 0;
  while (run.finite() && !run.world.facts().over) {
    run.cycle();
    for (std::size_t u = 0; u < run.subs.size(); ++u) {
      if (run.sent_frame(u)) bytes += static_cast<double>(frames[u].encode(run.frame(u)).size());
      if (run.sent_report(u)) bytes += static_cast<double>(reports[u].encode(run.report(u)).size());
    }
    ++cycles;
  }
  if (!run.finite()) throw Error(ExitCode::failed, "a state is not finite");
  Json felt = Json::array();
  for (const FeltHistory& user : run.felt) {
    Json forces = Json::array();
    for (const Vec3& f : user.force) forces.insert(forces.end(), {f.x(), f.y(), f.z()});
    felt.push_back(std::move(forces));
  }
  Json end = Json::array();
  for (const Body& body : scene.bodies) {
    const Vec3 at = run.world.engine().state(body.id).position;
    end.insert(end.end(), {at.x(), at.y(), at.z()});
  }
  const double clock = clock_s();
  return {{"world_cpu_s", sum_s(run.cpu.world, clock)},
          {"haptic_cpu_s", sum_s(run.cpu.haptic, clock) + sum_s(run.cpu.synchronise, clock)},
          {"bytes_per_cycle", cycles == 0 ? 0.0 : bytes / static_cast<double>(cycles)},
          {"memory_bytes", allocated_bytes() - before_bytes},
          {"start_cpu_s", start_s},
          {"hash", fmt::format("{:016x}", run.hash())},
          {"felt", std::move(felt)},
          {"end", std::move(end)}};
}

Json run_apart(const PlanPoint& point, const Scene& scene) {
  const Apart run = apart(kMost_s, [&] { return figures_of(scene); });
  if (!run.answer) {
    throw Error(ExitCode::failed, fmt::format("{}, {} {}: the run ended with {}", point.scene, point.item,
                                              scene.settings.disabled == kDisableNothing ? "on" : "off", run.end));
  }
  return *run.answer;
}

void keep_least(Json& best, const Json& run) {
  for (const Figure& figure : kFigures) best[figure.key] = std::min(number(best, figure.key), number(run, figure.key));
}

std::vector<FeltHistory> felt_of(const Json& run) {
  std::vector<FeltHistory> felt;
  for (const Json& forces : run.at("felt")) {
    FeltHistory& user = felt.emplace_back();
    for (std::size_t i = 0; i + 2 < forces.size(); i += 3)
      user.force.emplace_back(forces[i].get<double>(), forces[i + 1].get<double>(), forces[i + 2].get<double>());
  }
  return felt;
}

std::vector<BodyState> end_of(const Json& run) {
  const Json& places = run.at("end");
  std::vector<BodyState> end(places.size() / 3);
  for (std::size_t i = 0; i < places.size(); ++i)
    end[i / 3].position[static_cast<int>(i % 3)] = places[i].get<double>();
  return end;
}

double same_place_m(const Scene& scene) {
  double least_m = INFINITY;
  for (const Body& body : scene.bodies) {
    if (!body.fixed()) least_m = std::min(least_m, bounding_radius(body.shape, scene.meshes));
  }
  return kSamePlace * least_m;
}

/// The decision on the item, or on the first enabled item for "all".
Decision decision_of(const Scene& scene, const std::string& item) {
  Decision first{false, false, "no optimisation is on"};
  for (const PlannedItem& planned : plan_of(scene)) {
    if (item != "all" && planned.item->name != item) continue;
    if (planned.decision.enabled && !planned.decision.ordered) {
      return item == "all" ? Decision{true, false, "all optimisations of the plan"} : planned.decision;
    }
    if (item != "all") first = planned.decision;
  }
  return first;
}

}  // namespace

Json measured_plan_row(const PlanPoint& point, int repeats) {
  const Scene without = point.load();
  const Decision decision = decision_of(without, point.item);
  Json row = {
      {"scene", point.scene}, {"item", point.item}, {"enabled", decision.enabled}, {"reason", decision.because}};
  for (const Figure& figure : kFigures) row[figure.ratio] = kNotMeasured;
  row.update({{"hash_equal", true},
              {"force_difference_rms", 0.0},
              {"reference_error", kNotMeasured},
              {"error_enabled_rms", kNotMeasured},
              {"error_disabled_rms", kNotMeasured},
              {"position_difference_max_m", 0.0},
              {"reference_position_error_m", kNotMeasured},
              {"position_error_enabled_m", kNotMeasured},
              {"position_error_disabled_m", kNotMeasured},
              {"held", true}});
  if (!decision.enabled) return row;

  Scene with = without;
  with.settings.disable(parse_disabled({point.item}));
  Json out = run_apart(point, without), kept = run_apart(point, with);
  for (int i = 1; i < repeats; ++i) {
    keep_least(out, run_apart(point, without));
    keep_least(kept, run_apart(point, with));
  }
  for (const Figure& figure : kFigures) {
    row[figure.ratio] = number(out, figure.key) / number(kept, figure.key);
    row[fmt::format("{}_kept", figure.key)] = kept.at(figure.key);
  }
  row["hash_equal"] = out.at("hash") == kept.at("hash");
  if (row.at("hash_equal").get<bool>()) return row;
  const double difference = force_error(felt_of(out), felt_of(kept), without.settings.h_s).rms;
  row["force_difference_rms"] = difference;
  const double apart_m = drift_max_m(without, end_of(out), end_of(kept));
  row["position_difference_max_m"] = apart_m;
  if (difference == 0.0 && apart_m == 0.0) return row;
  // The reference has all optimisations off, and no passivity bound, which is no physics of the scene.
  const Apart judged = apart(kMost_s, [&]() -> Json {
    const std::optional<Reference> reference = reference_of(in_one_world(with));
    if (!reference) return nullptr;
    const auto error_of = [&](const Json& run) {
      return force_error(felt_of(run), reference->run.felt, without.settings.h_s).rms;
    };
    const auto drift_of = [&](const Json& run) { return drift_max_m(without, end_of(run), reference->run.end); };
    return {{"reference_error", reference->error},
            {"error_enabled_rms", error_of(out)},
            {"error_disabled_rms", error_of(kept)},
            {"reference_position_error_m", std::max(reference->drift_m, same_place_m(without))},
            {"position_error_enabled_m", drift_of(out)},
            {"position_error_disabled_m", drift_of(kept)}};
  });
  if (judged.answer && judged.answer->is_object()) row.update(*judged.answer);
  row["held"] = no_worse(row);
  return row;
}

bool no_worse(const Json& row) {
  const auto within = [&](const char* difference, const char* reference, const char* enabled, const char* disabled) {
    const double apart = number(row, difference), least = number(row, reference);
    // Without a felt force there is nothing to compare.
    return apart == 0.0 || !std::isfinite(apart) || apart <= least ||
           number(row, enabled) <= number(row, disabled) + least;
  };
  return within("force_difference_rms", "reference_error", "error_enabled_rms", "error_disabled_rms") &&
         within("position_difference_max_m", "reference_position_error_m", "position_error_enabled_m",
                "position_error_disabled_m");
}

}  // namespace subworld
