#include "lab/latency/measure.hpp"

#include "coupling/tool/stiffness.hpp"
#include "io/results/json.hpp"
#include "lab/coupling/analysis.hpp"
#include "lab/over_link/over_link.hpp"
#include "lab/session/draw.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

namespace subworld {

namespace {

/// Bodies give an operator energy in the reference too. An imperceptible error of the force changes it by as much.
constexpr double kOfTheReference = 1.0 + kImperceptibleRms;

/// Half of the delay each way; the odd step on the way to the sub-world.
void lengthen(Scene& scene, Link link, int steps) {
  DelaySettings& delay = scene.settings.delay;
  const double h_s = scene.settings.h_s;
  const int there = steps / 2, back = steps - there;
  (link == Link::world ? delay.up_s : delay.to_device_s) = there * h_s;
  (link == Link::world ? delay.down_s : delay.from_device_s) = back * h_s;
}

void set_errors(Criteria& values, const ForceError& error) {
  values[Criterion::rms] = error.rms;
  values[Criterion::p99] = error.p99;
  values[Criterion::offset] = std::abs(error.time_offset_s);
}

/// Stiffness of the coupling over the largest with which the device comes to rest in a wall. An admittance device has
/// no such limit.
double stiffness_ratio(const UserSpec& user, const Settings& settings) {
  if (user.device.kind != DeviceKind::impedance) return 0.0;
  return user.coupling.stiffness_n_m / largest_stiffness(user, settings);
}

std::vector<Criteria> criteria_of(const Scene& scene, Link link, const Outcome& run, const Outcome& reference) {
  std::vector<Criteria> users(run.felt.size());
  std::vector<ForceError> errors(users.size());
  if (run.finite) errors = force_errors(run.felt, reference.felt, scene.settings.h_s, &FeltHistory::on_operator);
  for (std::size_t u = 0; u < users.size(); ++u) {
    Criteria& values = users[u];
    const UserBalance& mine = run.balance[u];
    const UserBalance& without = reference.balance[u];
    values[Criterion::unstable] = run.finite ? 0.0 : 1.0;
    if (!run.finite) continue;
    set_errors(values, errors[u]);
    values[Criterion::energy] = std::max(0.0, mine.created_j - kOfTheReference * without.created_j);
    values[Criterion::oscillation] = std::max(0.0, mine.oscillation_n - without.oscillation_n);
    if (link == Link::device) values[Criterion::stiffness] = stiffness_ratio(scene.users[u], scene.settings);
  }
  return users;
}

/// One way: half of the delay, a message at most the jitter later, and its loss.
std::string emulated_link(const DelaySettings& link, double delay_s) {
  return fmt::format("delay {:.6f}ms {:.6f}ms loss {:.6f}%", 1e3 * 0.5 * (delay_s + link.jitter_s),
                     1e3 * 0.5 * link.jitter_s, 1e2 * link.loss_ratio);
}

/// Of a run of the real programs. Each begins its paths at an instant of its own. Empty if a signal requested a stop.
/// `disturbed`: see DelayedRun.
std::optional<std::vector<Criteria>> criteria_over_link(const LatencyQuestion& question, double delay_s,
                                                        std::string& disturbed) {
  Point point = question.point;
  point.starts_later_s = 0.0;
  const OverLink over{.link = emulated_link(scene_of(point).settings.delay, delay_s), .dds = question.dds};
  const std::optional<LinkedRun> run = undisturbed_run_over_link(point, over);
  if (!run) return std::nullopt;
  disturbed = run->disturbed;
  const Outcome& reference = run->reference;
  std::vector<Criteria> users(reference.felt.size());
  const std::vector<ForceError> errors =
      force_errors(run->felt, reference.felt, scene_of(point).settings.h_s, &FeltHistory::on_operator);
  for (std::size_t u = 0; u < users.size(); ++u) {
    const Json& device = run->summary.at("device").at(u);
    const UserBalance& without = reference.balance[u];
    set_errors(users[u], errors[u]);
    const double created_j = device.at("operator_energy").at("created_j");
    users[u][Criterion::energy] = std::max(0.0, created_j - kOfTheReference * without.created_j);
    users[u][Criterion::oscillation] = std::max(0.0, device.at("oscillation_n").get<double>() - without.oscillation_n);
  }
  return users;
}

void raise(std::vector<Criteria>& most, const std::vector<Criteria>& users) {
  if (most.empty()) most.resize(users.size());
  for (std::size_t u = 0; u < users.size(); ++u) {
    for (const CriterionText& text : kCriterionTexts) {
      double& value = most[u][text.criterion];
      if (!(users[u][text.criterion] <= value)) value = users[u][text.criterion];  // not a number stays
    }
  }
}

/// The scene with a start of its paths: each is a run of its own, with a reference of its own.
Point started(const LatencyQuestion& question, int start, double cycle_s) {
  Point point = question.point;
  point.starts_later_s = std::fmod(point.starts_later_s + start * cycle_s / question.starts, cycle_s);
  return point;
}

/// Of a run in lock-step, with the start of this number. Empty if a signal requested a stop.
std::optional<std::vector<Criteria>> criteria_in_lockstep(const LatencyQuestion& question, int delay, int start,
                                                          double cycle_s, References& references) {
  const Point point = started(question, start, cycle_s);
  Scene scene = scene_of(point);
  scene.settings.delay.seed = question.seed;
  lengthen(scene, question.link, delay);
  const Outcome* const reference = references.run_of(point);
  const std::optional<Outcome> run = reference != nullptr ? run_out(scene) : std::nullopt;
  if (!run) return std::nullopt;
  return criteria_of(scene, question.link, *run, *reference);
}

/// Empty if a signal requested a stop. `decided`: the users whose limits are searched.
std::optional<DelayedRun> measured_at(const LatencyQuestion& question, int delay, std::span<const std::size_t> decided,
                                      References& references) {
  constexpr double kNear = 0.5;
  DelayedRun at;
  const auto is_open = [&](std::size_t u) {
    return !exceeded(at.users[u], question.bounds) && nearness(at.users[u], question.bounds) > kNear;
  };
  const Settings settings = scene_of(question.point).settings;
  at.delay_s = delay * settings.h_s;
  do {
    const std::optional<std::vector<Criteria>> users =
        question.link == Link::emulated
            ? criteria_over_link(question, at.delay_s, at.disturbed)
            : criteria_in_lockstep(question, delay, at.starts, settings.longest_cycle_s(), references);
    if (!users) return std::nullopt;
    raise(at.users, *users);
    ++at.starts;
  } while (at.starts < question.starts && std::ranges::any_of(decided, is_open));
  return at;
}

/// Why no limit can be found; empty: one can.
std::string doubt_of(const Criteria& reference, const Criteria& bounds) {
  if (!std::isfinite(reference[Criterion::rms])) return "the reference felt no force in this time";
  const std::optional<Criterion> over = exceeded(reference, bounds);
  if (!over) return "";
  const CriterionText& text = kCriterionTexts[static_cast<std::size_t>(*over)];
  return fmt::format("the reference error is larger than the bound ({} {:.2g}{}, the bound {:.2g}{})", text.subject,
                     text.scale * reference[*over], text.unit, text.scale * bounds[*over], text.unit);
}

std::vector<Sample> samples_of(const LatencyAnswer& answer, std::size_t user) {
  std::vector<Sample> samples;
  for (const DelayedRun& run : answer.runs) samples.push_back({run.delay_s, run.users[user], !run.disturbed.empty()});
  return samples;
}

void conclude(LatencyAnswer& answer, const LatencyQuestion& question, const std::string& scene) {
  for (std::size_t u = 0; u < answer.limits.size(); ++u)
    answer.limits[u].limit = limit_of(samples_of(answer, u), question.bounds);
  answer.sentence =
      sentence_of({scene, words_of(question.link) + disturbance_of(answer.settings), answer.finished, answer.disturbed},
                  answer.limits);
  if (const auto& chosen_s = question.point.duration_s)
    answer.sentence += fmt::format("; looked at: the first {:g} s of the scene", *chosen_s);
}

/// What is known before the first run with a delay. Empty if a signal requested a stop.
const Reference* begin(LatencyAnswer& answer, const LatencyQuestion& question, const Scene& scene,
                       References& references) {
  answer.settings = {{"scene", scene.name},
                     {"link", name_of(question.link)},
                     {"jitter_s", scene.settings.delay.jitter_s},
                     {"loss_ratio", scene.settings.delay.loss_ratio},
                     {"scheme", scene.settings.scheme},
                     {"engine", scene.settings.world.name},
                     {"haptic_engine", scene.settings.haptic.name},
                     {"ratio", scene.settings.ratio},
                     {"h_s", scene.settings.h_s},
                     {"duration_s", scene.settings.duration_s},
                     {"seed", question.seed}};
  for (const UserSpec& user : scene.users) answer.limits.push_back({.name = user.name, .limit = {}, .undecided = ""});
  const Reference* reference = references.of(question.point);
  answer.reference.resize(scene.users.size());
  for (std::size_t u = 0; reference != nullptr && u < scene.users.size(); ++u) {
    set_errors(answer.reference[u], reference->on_operator_errors[u]);
    answer.limits[u].undecided = doubt_of(answer.reference[u], question.bounds);
  }
  return reference;
}

}  // namespace

const char* name_of(Link link) noexcept {
  constexpr const char* kNames[] = {"world", "device", "emulated"};
  return kNames[static_cast<std::size_t>(link)];
}

const char* words_of(Link link) noexcept {
  constexpr const char* kWords[] = {"round-trip delay", "device delay", "round-trip delay of an emulated link"};
  return kWords[static_cast<std::size_t>(link)];
}

std::string disturbance_of(const Json& settings) {
  const double jitter_s = settings.at("jitter_s"), loss = settings.at("loss_ratio");
  if (jitter_s == 0.0 && loss == 0.0) return "";
  return fmt::format(" with {:g} ms of jitter and {:g} % of loss", 1e3 * jitter_s, 1e2 * loss);
}

LatencyAnswer answer(const LatencyQuestion& question, References& references, const OnRun& on_run) {
  const Scene scene = scene_of(question.point);
  LatencyAnswer answer;
  const Reference* const reference = begin(answer, question, scene, references);
  std::vector<std::size_t> decided;
  for (std::size_t u = 0; u < answer.limits.size(); ++u) {
    if (answer.limits[u].undecided.empty()) decided.push_back(u);
  }
  DelayRange range = question.range;
  range.largest = std::max(1, static_cast<int>(std::lround(question.largest_s / scene.settings.h_s)));
  DelaySearch search(range, decided.size());
  for (auto delay = search.next(); delay && reference != nullptr; delay = search.next()) {
    std::optional<DelayedRun> at = measured_at(question, *delay, decided, references);
    if (!at) break;
    std::vector<bool> within;
    for (const std::size_t u : decided) within.push_back(!exceeded(at->users[u], question.bounds));
    search.add(*delay, within);
    const auto after = std::ranges::upper_bound(answer.runs, at->delay_s, {}, &DelayedRun::delay_s);
    const DelayedRun& added = *answer.runs.insert(after, std::move(*at));
    on_run(answer, added, search.most());
    if (!added.disturbed.empty() && !std::ranges::all_of(within, std::identity())) answer.disturbed = added.disturbed;
    if (!answer.disturbed.empty()) break;
  }
  answer.finished = reference != nullptr && !search.next() && answer.disturbed.empty();
  conclude(answer, question, scene.name);
  return answer;
}

void scatter(LatencyQuestion& question, std::uint64_t seed) {
  const Scene scene = scene_of(question.point);
  Draw draw(seed);
  question.seed = seed;
  question.range.phase = draw.between(0.0, 1.0);
  question.point.starts_later_s = draw.between(0.0, scene.settings.longest_cycle_s());
}

Rows rows_of(const LatencyQuestion& question, const LatencyAnswer& answer) {
  Rows rows;
  const auto row_of = [&](const char* kind, std::size_t user) {
    Json row = {{"kind", kind}};
    row.update(answer.settings);
    row.update({{"user", user}, {"user_name", answer.limits[user].name}});
    return row;
  };
  const auto add = [&](Json& row, const Sample* sample) {
    row["delay_s"] = sample != nullptr ? Json(sample->delay_s) : Json(nullptr);
    std::optional<Criterion> over;
    if (sample != nullptr) over = exceeded(sample->values, question.bounds);
    for (const CriterionText& text : kCriterionTexts)
      row[text.column] = sample != nullptr ? Json(sample->values[text.criterion]) : Json(nullptr);
    row["exceeded"] = over ? Json(kCriterionTexts[static_cast<std::size_t>(*over)].column) : Json(nullptr);
  };
  for (const DelayedRun& run : answer.runs) {
    for (std::size_t u = 0; u < run.users.size(); ++u) {
      const Sample sample{run.delay_s, run.users[u]};
      add(rows.emplace_back(row_of("point", u)), &sample);
      rows.back()["starts"] = run.starts;
      rows.back()["disturbed"] = run.disturbed;
    }
  }
  for (std::size_t u = 0; u < answer.limits.size(); ++u) {
    const Limit& limit = answer.limits[u].limit;
    add(rows.emplace_back(row_of("limit", u)), limit.beyond ? &*limit.beyond : nullptr);
    rows.back()["starts"] = nullptr;
    rows.back()["disturbed"] = answer.disturbed;
  }
  for (Json& row : rows) {
    const UserLimit& user = answer.limits[row.at("user").get<std::size_t>()];
    const bool decided = row.at("kind") == "limit" && user.undecided.empty();
    row["limit_s"] = decided && user.limit.within_s ? Json(*user.limit.within_s) : Json(nullptr);
    row["undecided"] = user.undecided;
    row["reference_error"] = answer.reference[row.at("user").get<std::size_t>()][Criterion::rms];
  }
  return rows;
}

}  // namespace subworld
